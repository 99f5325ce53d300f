"""A right-hand side in two halves, for large scenes: what each part of it does, and the meetings.

The elimination is cut in two halves and a top (linear/ordering/bisection.py), and with it bodies,
joints and forces: what touches the bodies of one half alone belongs to that half, all else to the
top. Each phase does one thing for both halves, at once where a second thread works beside the
first, and nothing that one half writes is read by the other before they have met. The top is done
between the phases. Sums are the same whether one thread works or two: numbers do not depend on it.

The threads meet by words of ``mail``. The first one posts a ticket and does the first half. Who
then takes the ticket does the second one: the first thread itself, where nobody was there in time.
So none waits for a thread that does not run.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import (
    BODIES,
    BY_BODIES,
    BY_ROWS,
    FORCES,
    HUBS,
    JOINTS,
    SCALED,
    VALUE,
    Floats,
    System,
)
from dap3d_core.assembly.evaluate import call_kinds, place_some, scale_forces, some_rates, zero
from dap3d_core.formulations.common.friction import keep_applied, rub, rubs, settle
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.atomic import (
    APART,
    address_of,
    give_way,
    load,
    pause,
    replace,
    store,
    vector_at,
)
from dap3d_core.kernels.runtime.cache import compiled, compiled_inside, compiled_into
from dap3d_core.linear.ldlt.factor import assemble, factor, solve_down, solve_up
from dap3d_core.linear.ldlt.saddle_point import (
    scale_blocks,
    subtract_column_products,
    subtract_row_products,
)
from dap3d_core.linear.ordering.bisection import FIRST, SECOND, TOP

#: What both halves do between two meetings.
PLACE, REDUCE, DOWN, UP, RATES = range(5)

#: Words of ``mail``: the last ticket posted, taken, done by the second thread; whether that is to
#: stop, and has gone; behind POSTED what the ticket is for.
POSTED, TAKEN, DONE, STOP, GONE, WORDS = range(0, 6 * APART, APART)
PHASE, STATE, RESULT, STATE_SIZE, RESULT_SIZE = range(POSTED + 1, POSTED + 6)
#: Places in ``numbers``: the time; of each part the power of its forces and that of its drivers.
TIME, POWER, DRIVEN = 0, APART, APART + 1
NUMBERS = 4 * APART

#: Looks at a word before a waiting thread gives way to others: some 20 us.
LOOKS = 1000


@compiled_inside
def place_part(part: int, t: float, y: Floats, system: System, loops: Any) -> None:
    """Bodies of a part, with no force on them so far."""
    h = system.halves
    for k in range(h.run_start[3 * BODIES + part], h.run_start[3 * BODIES + part + 1]):
        first, last = h.runs[k, 0], h.runs[k, 1]
        place_some(first, last, y, system.body, system.metric)
        zero(system.force[6 * first : 6 * last])


@compiled_inside
def evaluate_part(part: int, t: float, system: System, loops: Any) -> None:
    """Forces and joints of a part; its blocks of D, scaled."""
    h = system.halves
    for kind in (FORCES, JOINTS):
        p1, p2, p3 = pointer(system.force), pointer(system.gamma), pointer(system.nu)
        if kind == JOINTS:
            p1 = pointer(system.D)
        for k in range(h.piece_start[3 * kind + part], h.piece_start[3 * kind + part + 1]):
            loop = loops[h.pieces[k, 0]]
            loop(t, system, h.pieces[k, 1], h.pieces[k, 2], h.pieces[k, 3], p1, p2, p3)
    for k in range(h.run_start[3 * SCALED + part], h.run_start[3 * SCALED + part + 1]):
        scale_blocks(system.blocks[h.runs[k, 0] : h.runs[k, 1]], system.D, system.metric)


@compiled_inside
def load_part(part: int, system: System) -> None:
    """Scaled forces on the bodies of a part, and their power; its columns of K."""
    h, power = system.halves, 0.0
    for k in range(h.run_start[3 * BODIES + part], h.run_start[3 * BODIES + part + 1]):
        first, last = h.runs[k, 0] - 1, h.runs[k, 1]
        power += scale_forces(system.body[first:last], system.metric[first:last],
                              system.force[6 * first : 6 * last])  # fmt: skip
    h.numbers[POWER + APART * part] = power
    targets = system.targets[h.targets[part] : h.targets[part + 1]]
    assemble(targets, system.contributions, system.D, system.K)


@compiled_inside
def factor_part(part: int, system: System) -> None:
    """Factors of a part's columns of K."""
    h = system.halves
    nodes = system.nodes[h.nodes[part] : h.nodes[part + 1] + 1]
    factor(nodes, h.columns, h.updates, system.K, system.smallest, False)


@compiled_inside
def start_rows(part: int, system: System) -> None:
    """The right-hand side of a part's rows, but for what its bodies do to them."""
    h, x = system.halves, system.x
    for k in range(h.rows[part], h.rows[part + 1]):
        x[k] = system.gamma[k]
    for k in range(h.run_start[3 * HUBS + part], h.run_start[3 * HUBS + part + 1]):
        for q in range(h.runs[k, 0], h.runs[k, 1]):
            for c in range(6):
                x[system.hubs[q, 1] + c] = system.force[6 * system.hubs[q, 0] + c]


@compiled_inside
def go_down(part: int, system: System) -> None:
    """What the bodies of a part do to its rows, and these to others, on the way down."""
    h, blocks = system.halves, system.blocks
    D, force, x = pointer(system.D), pointer(system.force), pointer(system.x)
    for k in range(h.run_start[3 * BY_ROWS + part], h.run_start[3 * BY_ROWS + part + 1]):
        for q in range(h.runs[k, 0], h.runs[k, 1]):
            if blocks[q, 4] == 0:
                subtract_row_products(blocks, q, D, force, x)
    nodes = system.nodes[h.nodes[part] : h.nodes[part + 1] + 1]
    solve_down(nodes, h.columns, pointer(system.K), x)


@compiled_inside
def go_up(part: int, system: System) -> None:
    """Multipliers of a part, and accelerations of its bodies."""
    h, blocks, g = system.halves, system.blocks, system.force
    D, force, x = pointer(system.D), pointer(g), pointer(system.x)
    nodes = system.nodes[h.nodes[part] : h.nodes[part + 1] + 1]
    solve_up(nodes, system.columns, pointer(system.K), x)
    for k in range(h.run_start[3 * BY_BODIES + part], h.run_start[3 * BY_BODIES + part + 1]):
        for q in range(h.runs[k, 0], h.runs[k, 1]):
            if blocks[q, 4] == 0:
                subtract_column_products(blocks, q, D, x, force)
    for k in range(h.run_start[3 * HUBS + part], h.run_start[3 * HUBS + part + 1]):
        for q in range(h.runs[k, 0], h.runs[k, 1]):
            for c in range(6):
                g[6 * system.hubs[q, 0] + c] = system.x[system.hubs[q, 1] + c]


@compiled_inside
def rates_of_part(part: int, y: Floats, out: Floats, system: System) -> None:
    """dy/dt of a part's bodies, and the power of its drivers."""
    h = system.halves
    for k in range(h.run_start[3 * BODIES + part], h.run_start[3 * BODIES + part + 1]):
        some_rates(h.runs[k, 0], h.runs[k, 1], y, system.metric, system.force, out)


@compiled_inside
def drive_part(part: int, system: System) -> None:
    """Power of the reactions in a part's rows, as ``power_of_drivers`` has it."""
    h, power = system.halves, 0.0
    for k in range(h.rows[part], h.rows[part + 1]):
        power -= system.x[k] * system.nu[k]
    h.numbers[DRIVEN + APART * part] = power


@compiled
def do_half(
    phase: int, half: int, t: float, y: Floats, out: Floats, system: System, loops: Any
) -> None:
    """What one half does in a phase."""
    if phase == PLACE:
        place_part(half, t, y, system, loops)
        evaluate_part(half, t, system, loops)
    elif phase == REDUCE:
        load_part(half, system)
        factor_part(half, system)
        start_rows(half, system)
        go_down(half, system)
    elif phase == DOWN:
        start_rows(half, system)
        go_down(half, system)
    elif phase == UP:
        go_up(half, system)
        drive_part(half, system)
    else:
        rates_of_part(half, y, out, system)


@compiled_into
def wait(looks: int) -> int:
    """A moment's wait after so many looks at a word; the number of looks then."""
    if looks < LOOKS:
        pause()
    else:
        give_way()
    return looks + 1


@compiled_inside
def do_both(phase: int, t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """A phase of both halves, the second one by another thread where one is there."""
    h = system.halves
    mail = h.mail
    ticket = load(mail, POSTED) + 1
    h.numbers[TIME] = t
    mail[PHASE], mail[STATE_SIZE], mail[RESULT_SIZE] = phase, y.shape[0], out.shape[0]
    mail[STATE], mail[RESULT] = address_of(y), address_of(out)
    store(mail, POSTED, ticket)
    do_half(phase, FIRST, t, y, out, system, loops)
    taken = load(mail, TAKEN)
    if taken < ticket and replace(mail, TAKEN, taken, ticket):
        do_half(phase, SECOND, t, y, out, system, loops)
        return
    looks = 0
    while load(mail, DONE) != ticket and load(mail, GONE) == 0:
        looks = wait(looks)


@compiled
def work_beside(system: System, loops: Any) -> None:
    """What the second thread does: second halves, as they are posted, until it is to stop."""
    h, looks = system.halves, 0
    mail = h.mail
    while load(mail, STOP) == 0:
        ticket, taken = load(mail, POSTED), load(mail, TAKEN)
        if taken < ticket and replace(mail, TAKEN, taken, ticket):
            y = vector_at(mail[STATE], mail[STATE_SIZE])
            out = vector_at(mail[RESULT], mail[RESULT_SIZE])
            do_half(mail[PHASE], SECOND, h.numbers[TIME], y, out, system, loops)
            store(mail, DONE, ticket)
            looks = 0
        else:
            looks = wait(looks)


@compiled_inside
def prepare_top(t: float, system: System, loops: Any) -> None:
    """The top before both halves add to it; needs all bodies placed."""
    h, K = system.halves, system.K
    evaluate_part(TOP, t, system, loops)
    load_part(TOP, system)
    start_rows(TOP, system)
    for k in range(h.matrix[0] + h.matrix[1], K.shape[0]):
        K[k] = 0.0


@compiled_inside
def solve_top(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The rows of the top, with what both halves have added to them, and then all others."""
    h, x = system.halves, system.x
    size = x.shape[0] - h.rows[3]
    for k in range(h.rows[TOP], h.rows[3]):
        x[k] += x[k + size]
        x[k + size] = 0.0
    go_down(TOP, system)
    go_up(TOP, system)
    drive_part(TOP, system)
    do_both(UP, t, y, out, system, loops)


@compiled_inside
def accelerate(t: float, y: Floats, out: Floats, system: System, loops: Any) -> float:
    """Scaled accelerations into ``force``, -lambda into ``x``; power of forces and drivers."""
    h, K, numbers = system.halves, system.K, system.halves.numbers
    call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)
    place_part(TOP, t, y, system, loops)
    do_both(PLACE, t, y, out, system, loops)
    prepare_top(t, system, loops)
    do_both(REDUCE, t, y, out, system, loops)
    for k in range(h.matrix[0], h.matrix[0] + h.matrix[1]):
        K[k] += K[k + h.matrix[1]]
    factor_part(TOP, system)
    power, passes = 0.0, 0
    if rubs(system):
        keep_applied(system)
    solve_top(t, y, out, system, loops)
    if rubs(system):
        while not settle(system, passes):
            passes += 1
            power = rub(t, system, loops)
            start_rows(TOP, system)
            do_both(DOWN, t, y, out, system, loops)
            solve_top(t, y, out, system, loops)
    for part in (POWER, DRIVEN):
        power += numbers[part] + numbers[part + APART] + numbers[part + 2 * APART]
    return power
