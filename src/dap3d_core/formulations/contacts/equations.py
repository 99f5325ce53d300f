"""Right-hand side, projection, report and switches of scenes with contacts (lsq.py has the rows).

Sliding friction is linear in the normal force of its contact, or in the load of its joint. So the
rows are factored once and solved once more for each contact that slides, by its friction of a
normal force of one; what these forces are follows from as many equations:

    N = N_0 + L N,    L_rs the normal force at r by friction of a normal force of one at s.

The load of a joint is the root of a sum of squares of multipliers, which are linear in N: Newton's
method finds N. Where there is no such N friction jams, and nothing is returned but not-a-numbers.

The compliance of the rows is so large that multipliers of rows that depend on each other have no
rounding of their own: they are the least ones. Passes (lsq.py) remove what it changes. Where rows
hold so weakly that passes do not, it is made smaller. Where pivots show that rows do not depend on
each other it is next to nothing, and one pass is enough.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    FIRST_STATE,
    KNOT,
    SCRATCH,
    SHARE,
    SWITCH,
    TOLERANCE_C,
    TOLERANCE_V,
    Floats,
    System,
)
from dap3d_core.assembly.evaluate import (
    add_force,
    call_kinds,
    copy,
    evaluate_forces,
    global_accelerations,
    place,
    place_states,
    put_rates,
    zero,
)
from dap3d_core.assembly.state_update import size_of_positions, size_of_velocities
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.constraints import (
    factorise,
    factorise_regularised,
    linearise,
    power_of_drivers,
    report_levels,
    report_multipliers,
    slide_sharing,
    solve_rows,
)
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.formulations.contacts.watched_rates import store_watched, take_watched
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import is_differentiated, where, with_slopes
from dap3d_core.linear.ldlt.factor import LEAST_ALIKE, weigh_alike
from dap3d_core.linear.least_squares import invert

#: Compliance of a row as part of its squared length; how much less where passes do not converge,
#: and the least. That of rows that do not depend on each other: no pivot is less than this part of
#: the square of its row.
PART, SMALLER, LEAST = 1e-4, 1e-3, 1e-12
PART_OF_INDEPENDENT, LEAST_PIVOT = 1e-16, 1e-1
#: Passes at most; each is to leave this part of the one before. They end where they change
#: multipliers by this part, as the next would by a compliance of that, or by rounding alone, which
#: rows that depend on each other enlarge. Of shares, too, where some slide: what sticks is not to
#: creep by their rounding.
PASSES, FALLING, SETTLED, NOISE = 12, 0.1, 1e-12, 1e-9
#: A projection that leaves this many times the tolerance, which rounding does not, goes on.
REACHED = 1e3
#: Columns of ``System.contacts``: of each point its loop and where its integers and numbers begin,
#: its first row, bodies, first state; 1 of friction that is the same under any load; of friction of
#: a joint the first row of its load, their number, 1 where that pushes alone; what presses it.
LOOP, INTEGERS, NUMBERS, ROW, BODY_I, BODY_J, STATE = *range(6), FIRST_STATE
LOADED, LOAD, LOADS, PUSHES, UNDER, COLUMNS = range(7, 13)
#: Passes of Newton's method for loads, and the part that the last one changes.
LOAD_PASSES, LOAD_SETTLED = 50, 1e-14
#: Places in a column, from its end: of its contact, of the normal force, of its power.
PLACE, FORCE, POWER = 1, 2, 3
#: Of a contact's states behind its mode: the direction of sliding, what it is given; how many.
WAY, NEAR, OF_CONTACT = 1, SHARE, 7
#: Modes (interface/contacts/rows.py) are above these.
_OPEN, _SLIDING = 0.5, 1.5


def memory_size(bodies: int, rows: int, contacts: int) -> int:
    """Numbers of ``System.friction`` (bodies: with ground).

    Applied forces; forces of one contact; of each that slides a ``column`` and an equation.
    """
    return 12 * bodies + contacts * (6 * bodies + rows + POWER + 2 * contacts + 2)


@compiled
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled ``acceleration`` and ``multipliers``; returns the power of forces and drivers."""
    power = evaluate_forces(t, y, system, loops)
    linearise(t, system, loops)
    zero(system.multipliers)
    contacts, size = system.contacts, system.acceleration.shape[0]
    applied, force, closed = system.friction[:size], system.friction[size : 2 * size], 0
    for c in range(contacts.shape[0]):
        closed |= mode_of(system, c) > _OPEN
        if is_given(system, c) or (contacts[c, LOADED] == 1 and is_sliding(system, c)):
            power += force_of(t, c, force, system.acceleration, system, loops)
    if closed == 0 and system.row.shape[0] == 3 * contacts.shape[0]:
        return power
    copy(applied, system.acceleration)
    given = largest_given(system)
    part = PART if given > 0.0 else PART_OF_INDEPENDENT
    factorise_contacts(system, part)
    if given == 0.0 and not are_independent(system):
        part = PART
        factorise_contacts(system, part)
    count = add_columns(t, system, loops)
    while not has_settled(system, count, given, part) and part > LEAST:
        part = PART if part == PART_OF_INDEPENDENT else part * SMALLER
        factorise_contacts(system, part)
        count = add_columns(t, system, loops)
        copy(system.acceleration, applied)
    for c in range(count):
        own = column(system, c)
        power += own[own.shape[0] - POWER] * own[own.shape[0] - FORCE]
    return power + power_of_drivers(system)


@compiled_into
def factorise_contacts(system: System, part: float) -> None:
    """Factors; what slides and shares does so as on feet of one stiffness."""
    if slide_sharing(system):
        weigh_alike(system.blocks, system.D, part, LEAST_ALIKE, system.compliance)
        factorise_regularised(system)
    else:
        factorise(system, part)


@compiled_into
def column(system: System, c: int) -> Floats:
    """What friction of contact c of those that slide does by a normal force of one.

    Accelerations, multipliers, power; then the normal force and its row.
    """
    size, rows = system.acceleration.shape[0], system.multipliers.shape[0]
    width = size + rows + POWER
    return system.friction[2 * size + c * width : 2 * size + (c + 1) * width]


@compiled_into
def mode_of(system: System, c: int) -> float:
    """The mode of a contact."""
    return system.states[system.contacts[c, STATE]]


@compiled_into
def is_sliding(system: System, c: int) -> bool:
    """True if a contact slides."""
    mode = mode_of(system, c)
    return (mode > _OPEN) & (mode < _SLIDING)


@compiled_into
def is_given(system: System, c: int) -> bool:
    """True if a contact has a force besides those of its rows, its own or by what presses it."""
    own, under = system.contacts[c, STATE] + NEAR, near_of(system, c)
    mode, states = mode_of(system, c), system.states
    some = False  # a trace adds conditions to it
    for k in range(3):
        some |= (mode > _OPEN) & (states[own + k] != 0.0)
        some |= (mode > _OPEN) & (mode < _SLIDING) & (states[under + k] != 0.0)
    return some


@compiled_into
def near_of(system: System, c: int) -> int:
    """The first state of the share of the contact whose normal force presses."""
    return system.contacts[system.contacts[c, UNDER], STATE] + NEAR


@compiled_into
def pressed_row(system: System, c: int) -> int:
    """The row of what presses: a normal force, or the first of the load of a joint."""
    row = system.contacts[c]
    return int(row[LOAD] if row[LOADS] > 0 else system.contacts[row[UNDER], ROW])


@compiled
def largest_given(system: System) -> float:
    """The largest component of the forces that contacts are given: a size of multipliers."""
    found, states = 0.0, system.states
    for c in range(system.contacts.shape[0]):
        if is_given(system, c):
            near = system.contacts[c, STATE] + NEAR
            for k in range(near, near + 3):
                found = where(abs(states[k]) > found, abs(states[k]), found)
    return found


@compiled
def force_of(t: float, c: int, force: Floats, out: Floats, system: System, loops: Any) -> float:
    """What contact c does besides its rows, with ``multipliers``, added to scaled forces ``out``.

    force: (6 (n+1),) scratch. Returns its power.
    """
    row = system.contacts[c]
    loop, x = loops[row[LOOP]], pointer(system.multipliers)
    for side in range(BODY_I, BODY_J + 1):
        zero(force[6 * row[side] : 6 * row[side] + 6])
    loop(t, system, row[INTEGERS], row[NUMBERS], 1, pointer(force), x, x)
    power = 0.0
    for side in range(BODY_I, BODY_J + 1):
        if row[side] > 0:
            power = add_force(row[side], force, out, system, power)
    return power


@compiled
def force_of_one(t: float, c: int, force: Floats, out: Floats, system: System, loops: Any) -> float:
    """As ``force_of``, of the friction of contact c by a normal force or a load of one alone."""
    states, near = system.states, near_of(system, c)
    given = states[near], states[near + 1], states[near + 2]
    states[near] = states[near + 1] = states[near + 2] = 0.0
    zero(system.multipliers)
    system.multipliers[pressed_row(system, c)] = -1.0
    power = force_of(t, c, force, out, system, loops)
    states[near], states[near + 1], states[near + 2] = given
    return power


@compiled
def add_columns(t: float, system: System, loops: Any) -> int:
    """Solve, with the present factors, for friction of each contact that slides; their number.

    Behind the columns stands what gives normal forces from those without friction: (I - L)^-1.
    """
    size, count, contacts, x = system.acceleration.shape[0], 0, system.contacts, system.multipliers
    for c in range(contacts.shape[0]):
        if is_sliding(system, c) and contacts[c, LOADED] == 0:
            own, force = column(system, count), system.friction[size : 2 * size]
            zero(own)
            own[own.shape[0] - POWER] = force_of_one(t, c, force, own[:size], system, loops)
            zero(x)
            solve_rows(system, own[:size])
            for k in range(x.shape[0]):
                own[size + k] = x[k]
            own[own.shape[0] - PLACE] = float(c)
            count += 1
    invert_responses(system, count)
    return count


@compiled
def invert_responses(system: System, count: int) -> None:
    """(I - L)^-1 behind the columns, where no load of a joint presses; NaN unless det > 0."""
    if has_loads(system, count):
        return
    A, size = inverse(system, count), system.acceleration.shape[0]
    for r in range(count):
        place = pressed_row(system, contact_of(system, r))
        for s in range(count):
            A[2 * count * r + s] = column(system, s)[size + place] + (1.0 if r == s else 0.0)
            A[2 * count * r + count + s] = 1.0 if r == s else 0.0
    if count > 0 and not invert(A, count) > 0.0:
        A[count] = np.inf - np.inf


@compiled_into
def contact_of(system: System, c: int) -> int:
    """Contact c of those that slide among all."""
    own = column(system, c)
    return int(own[own.shape[0] - PLACE])


@compiled_into
def has_loads(system: System, count: int) -> bool:
    """True if friction of a joint is among what slides."""
    found = False
    for c in range(count):
        found |= system.contacts[contact_of(system, c), LOADS] > 0
    return found


@compiled_into
def inverse(system: System, count: int) -> Floats:
    """Space behind the columns."""
    size, rows = system.acceleration.shape[0], system.multipliers.shape[0]
    return system.friction[2 * size + count * (size + rows + POWER) :]


@compiled
def add_pass(system: System, count: int, again: bool) -> None:
    """Solve for what ``acceleration`` leaves of the rows; what is found has its friction.

    again: once more where passes have settled, for derivatives alone.
    """
    x, total, size = system.multipliers, system.total, system.acceleration.shape[0]
    kept = system.friction[size : 2 * size]
    for k in range(size if again else 0):
        kept[k] = system.acceleration[k]
    copy(x, system.gamma)
    solve_rows(system, system.acceleration)
    N = pressing(system, count)
    for r in range(count):
        own = column(system, r)
        for k in range(size):
            system.acceleration[k] += N[r] * own[k]
        for k in range(x.shape[0]):
            x[k] += N[r] * own[size + k]
        before = own[own.shape[0] - FORCE]
        own[own.shape[0] - FORCE] = with_slopes(before if again else before + N[r], before + N[r])
    for k in range(size if again else 0):
        system.acceleration[k] = with_slopes(kept[k], system.acceleration[k])
    for k in range(x.shape[0]):
        total[k] = with_slopes(total[k] if again else total[k] + x[k], total[k] + x[k])


@compiled_into
def pressing(system: System, count: int) -> Floats:
    """Changes N of normal forces and loads, from ``multipliers`` found without them."""
    A, x = inverse(system, count), system.multipliers
    N = A[2 * count * count :]
    if has_loads(system, count):
        solve_loads(system, count)
    else:
        for r in range(count):
            N[r] = 0.0
            for s in range(count):
                place = pressed_row(system, contact_of(system, s))
                N[r] -= A[2 * count * r + count + s] * x[place]
    return N


@compiled
def solve_loads(system: System, count: int) -> None:
    """As ``pressing``, where loads of joints are among them; not numbers where friction jams."""
    A, n = inverse(system, count), 2 * count * count
    N, rest = A[n : n + count], A[n + count :]
    zero(N)
    settled, before, step, largest_load = False, np.inf, 0.0, 0.0
    for _ in range(LOAD_PASSES):
        for r in range(count):
            rest[r] = fill_load(system, count, r, A[2 * count * r :])
        invert(A, count)
        step = largest_load = 0.0
        for r in range(count):
            change = 0.0
            for s in range(count):
                change += A[2 * count * r + count + s] * rest[s]
            N[r] = with_slopes(N[r] if settled else N[r] + change, N[r] + change)
            own, step = column(system, r), max(step, abs(change))
            largest_load = max(largest_load, abs(N[r] + own[own.shape[0] - FORCE]))
        stands = step <= NOISE * largest_load and step > FALLING * before
        if settled:
            return
        settled, before = step <= LOAD_SETTLED * largest_load or stands, step
        if settled and not is_differentiated():
            return  # else a pass more, for derivatives alone
    if not step <= NOISE * largest_load:
        N[0] = np.inf - np.inf


@compiled
def fill_load(system: System, count: int, r: int, A: Floats) -> float:
    """What is left of an equation of ``solve_loads``; its derivatives by N into A (2 count,)."""
    x, total, size = system.multipliers, system.total, system.acceleration.shape[0]
    N, own = inverse(system, count)[2 * count * count :], column(system, r)
    c = contact_of(system, r)
    first, loads = system.contacts[c, LOAD], system.contacts[c, LOADS]
    for s in range(count):
        A[s] = A[count + s] = 1.0 if r == s else 0.0
    if loads == 0:  # a normal force, of a pass
        row = pressed_row(system, c)
        rest = -x[row] - N[r]
        for s in range(count):
            rest -= column(system, s)[size + row] * N[s]
            A[s] += column(system, s)[size + row]
        return rest
    square = 0.0
    for row in range(first, first + loads):
        y = total[row] + x[row]
        for s in range(count):
            y += column(system, s)[size + row] * N[s]
        if system.contacts[c, PUSHES] != 0 and y > 0.0:  # multipliers are -lambda
            y = 0.0
        square += y * y
        for s in range(count):
            A[s] -= y * column(system, s)[size + row]
    load = np.sqrt(square) if square > 0.0 else 0.0
    for s in range(count):
        same = 1.0 if r == s else 0.0
        A[s] = same + (A[s] - same) / (load if load > 0.0 else 1.0)
    return load - own[own.shape[0] - FORCE] - N[r]


@compiled
def are_independent(system: System) -> bool:
    """True if the factors, of ``PART_OF_INDEPENDENT``, have no small pivot."""
    nodes, small = system.nodes, 0
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for r in range(m if nodes[k, 3] < 0 else 0):
            of_row = abs(system.K[d + r * (m + 1)]) * system.compliance[f + r]
            small |= not of_row * LEAST_PIVOT < PART_OF_INDEPENDENT
    return small == 0


@compiled
def has_settled(system: System, count: int, given: float, part: float) -> bool:
    """``acceleration`` and ``multipliers`` from the forces in ``acceleration``, in passes.

    given: the largest share. part: of the factors. False where passes did not converge.
    """
    x, total, before, change, found = system.multipliers, system.total, 0.0, 0.0, 0.0
    zero(total)
    for k in range(PASSES):
        add_pass(system, count, False)
        if part == PART_OF_INDEPENDENT:
            return True
        change, found = 0.0, 0.0
        for r in range(x.shape[0]):
            if system.compliance[r] != 0.0:  # else a hub's place, or a row that is zero
                of_row, of_all = abs(x[r]), abs(total[r])
                change = where(of_row > change, of_row, change)
                found = where(of_all > found, of_all, found)
        enough = SETTLED * (found + given if count > 0 else found)
        if change <= enough or (k > 0 and not change < FALLING * before):
            break
        before = change
    if is_differentiated():
        add_pass(system, count, True)
    copy(x, total)
    return change <= NOISE * (found + given)


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """As in lsq.py."""
    if not take_watched(t, y, out, system):
        find_rates(t, y, out, system, loops)


@compiled
def find_rates(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    put_rates(t, y, accelerate(t, y, system, loops), out, system, loops)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto its constraints; out as in ``project_onto``.

    Where masses differ much, rows of a light body between heavy ones hold so weakly that passes do
    not get there: it goes on with the compliance of lsq.py, as no multipliers are read here.
    """
    project_onto(t, y, out, system, loops, constraints, PART, True, True)
    most_c = REACHED * system.settings[TOLERANCE_C] * size_of_positions(y, system)
    most_v = REACHED * system.settings[TOLERANCE_V] * size_of_velocities(y, system)
    if out[1] == 1.0 or out[2] > most_c or out[3] > most_v:
        out[0] = 0.0
        project_onto(t, y, out, system, loops, constraints, constraints.PART, True, False)
        out[0] = 1.0


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """As in lsq.py."""
    accelerate(t, y, system, loops)
    global_accelerations(system.metric, system.acceleration, out)
    report_levels(t, y, out, system, loops)
    report_multipliers(system, out)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``, by groups and instances; then distances from knots.

    Those of closed contacts read multipliers.
    """
    place_of_next, watched = system.settings[SCRATCH : SCRATCH + 1], system.watched
    place_states(y, system)
    closed = 0
    for c in range(system.contacts.shape[0]):
        closed |= mode_of(system, c) > _OPEN
    watched[0] = np.inf - np.inf
    if closed == 0:
        place(t, y, system, loops)
    else:
        n = y.shape[0]
        find_rates(t, y, watched[1 + n : 1 + 2 * n], system, loops)
        store_watched(t, y, system)
    place_of_next[0] = 0.0
    call_kinds(SWITCH, KNOT, t, system, loops, out, place_of_next, system.multipliers)
