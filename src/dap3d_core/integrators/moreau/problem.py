"""The problem of one step: which impulses of its contacts keep bodies apart, with friction.

Bodies that joints and contacts connect, without ground, are a group. No group feels what another
one does, and each is solved as if it were alone.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.moreau import reduced
from dap3d_core.integrators.moreau.arrays import CONE, StepArrays
from dap3d_core.integrators.moreau.contact_set import put_inertia, put_speeds
from dap3d_core.integrators.moreau.gauss_seidel import copy_impulses, sweep_bodies, sweep_contacts
from dap3d_core.integrators.moreau.matrix import lay_out
from dap3d_core.integrators.moreau.newton import (
    TINY,
    impulse_of,
    left_at,
    put_velocities,
    residual_of,
    rim_of,
    solve_round,
    times_inverse,
)
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Columns of ``first``: what the lists of a group begin with.
BODY, CONTACT, ROW = range(3)
#: Residual from which Newton's method begins, and sweeps of Gauss-Seidel that lead there.
NEAR, SWEEPS = 1e-4, 200
#: Over-relaxation of sweeps: piles of spheres took 1250 sweeps with 1, 720 with 1.5, and more than
#: 4000 with 1.7. It ends where a round of sweeps has not helped.
RELAX = 1.4
#: Sweeps at most, where Newton's method does not end.
MOST_SWEEPS = 2000
#: Contacts up to which a problem is solved to rounding, whatever the tolerance.
FEW, RESIDUAL_ROUNDING = 100, 1e-14
#: Part of the largest momentum that the velocities of joints have rounding of, over that asked for:
#: where nothing presses, joints pull by that rounding alone.
LEAST_IMPULSE = 1e-3
#: Weights times the masses that rows feel, at first; in the problem of contacts alone at first, and
#: at most.
WEIGHT, ALONE_WEIGHT, MOST_WEIGHT = 1e5, 1e7, 1e10
#: A round helps where it leaves less than this part of the residual. Where nothing else has led to
#: a solution, rounds that leave no more than the next ask for a larger weight: what hardly moves is
#: felt with that alone, and shares of a load move far by it. Rounds at most.
HELPS, WORSE, ROUNDS = 0.5, 1.1, 40
#: Part of the tolerance to which a round is solved.
INNER = 1e-2
#: A residual from which a round that does not help is the last.
SETTLED = 2e-14
#: Of contacts held between bodies that joints guide: rounds of sweeps and Newton's method at most;
#: passes in which joints answer, and are met; part of its own below which a contact cannot move.
HELD_ROUNDS, ANSWERED, MET, HELD = 3, 2, 3, 1e-12
#: Residual above which rows of light bodies are taken as those of what these carry.
CARRIED = 1e-12


@compiled
def prepare_problem(s: StepArrays) -> None:
    """What contacts feel of the masses as placed: J M^-1, and its diagonal blocks."""
    put_inertia(s)
    for c in range(s.contact_count):
        J, moved, own = s.J[c], s.moved[c], s.own[c]
        for side in range(6):
            times_inverse(s, s.bodies[c, side % 2], J[6 * side :], moved[6 * side :])
        for r in range(3):
            for q in range(3):
                total = 0.0
                for k in range(12):
                    total += moved[12 * r + k] * J[12 * q + k]
                own[3 * r + q] = total


@compiled
def take_own(s: StepArrays) -> None:
    """Take rows of a group as those of the masses of its bodies."""
    s.carries = 0
    for q in range(s.chosen_count):
        own = s.own[s.chosen[q]]
        s.r[s.chosen[q]] = 1.0 / max(own[0], own[4], own[8], TINY)
    for n in range(s.row_count):
        k, felt = s.rows[n], 0.0
        for q in range(s.row_start[k], s.row_start[k + 1]):
            D, turned = s.D[q], s.change
            times_inverse(s, s.row_body[q], D, turned)
            for i in range(6):
                felt += D[i] * turned[i]
        s.s[k] = 1.0 / max(felt, TINY)


@compiled
def take_carried(s: StepArrays) -> None:
    """Take rows of light bodies as those of what these carry, which is what resists.

    With their own masses, 1e-6 of those, a round of Newton's method leaves nearly all it finds.
    """
    s.carries = 1
    for q in range(s.chosen_count):
        c = s.chosen[q]
        i, j, J, most = s.bodies[c, 0], s.bodies[c, 1], s.J[c], TINY
        if s.carried[i, 0] + s.carried[j, 0] > 0.0:
            for r in range(3):
                felt = felt_by(s, i, J[12 * r :]) + felt_by(s, j, J[12 * r + 6 :])
                most = max(most, felt)
            s.r[c] = 1.0 / most
    for n in range(s.row_count):
        k, felt, light = s.rows[n], TINY, 0.0
        for q in range(s.row_start[k], s.row_start[k + 1]):
            felt += felt_by(s, s.row_body[q], s.D[q])
            light += s.carried[s.row_body[q], 0]
        if light > 0.0:
            s.s[k] = 1.0 / felt


@compiled
def felt_by(s: StepArrays, b: int, J: Floats) -> float:
    """J M^-1 J^T of body b, of what it carries where that is far heavier."""
    heavy, turned, found = s.carried[b], s.turned, 0.0
    times_inverse(s, b, J, turned)
    for k in range(6):
        felt = J[k] * heavy[k // 3] if heavy[0] > 0.0 else turned[k]
        found += felt * J[k]
    return found


@compiled
def solve(s: StepArrays, tolerance: float) -> bool:
    """Find the impulses x, y and velocities v of contacts, u = J v + bias; False without room.

    Args:
        s: with velocities ``free`` that fit the joints; ``bias`` is added to velocities, of which
            normal ones are not to become negative then; ``x``, ``y`` are tried first;
            ``free_speed`` is what joints ask of D v.
        tolerance: of the residual, a part of the largest impulse.
    """
    worst = 0.0
    for b in range(s.v.shape[0]):
        copy(s.v[b], s.free[b])
        copy(s.trial[b], s.free[b])
    list_groups(s)
    for b in range(1, s.v.shape[0]):
        if s.first[b, BODY] >= 0:
            choose(s, b)
            if not solve_group(s, tolerance):
                return False
            worst = max(worst, s.residual)
    s.residual = worst
    return True


@compiled
def solve_group(s: StepArrays, tolerance: float) -> bool:
    """Find the impulses of a group, and velocities with them; arguments as of ``solve``."""
    few, joined = s.chosen_count <= FEW, s.row_count > 0
    s.least = s.residual = 0.0
    for q in range(s.used_count):
        b = s.used[q]
        for k in range(3):
            s.least = max(s.least, LEAST_IMPULSE * s.mass[b] * abs(s.free[b, k]))
    if s.chosen_count == 0:
        for n in range(s.row_count):
            s.y[s.rows[n]] = 0.0
        return True
    take_own(s)
    if few or joined:
        aim = RESIDUAL_ROUNDING if few and tolerance < NEAR else tolerance
        s.residual = 1e300
        if joined and 3 * s.chosen_count <= s.small_step.size:  # few beside joints: alone
            if not reduced.factor_joints(s):
                return False
            s.residual = newton(s, aim, True)
            if s.residual <= max(aim, CARRIED):
                return True
        if s.residual > aim:
            if not lay_out(s, s.dense_size):
                return False
            s.residual = newton(s, aim, False)
        if s.residual > max(aim, CARRIED) and s.light_count > 0:
            take_carried(s)
            s.residual = newton(s, aim, False)
        if few and joined and s.residual > tolerance and not refine_held(s, tolerance, aim):
            return False
        if joined and s.residual > tolerance:
            s.residual = newton(s, aim, False, True)
    if s.carries == 0 and judge(s) > tolerance and not joined:
        sweep(s, SWEEPS, max(tolerance, NEAR), RELAX)
        if not finish(s, tolerance):
            return False
    if s.carries == 0:  # ``judge`` has put them
        for q in range(s.used_count):
            copy(s.v[s.used[q]], s.trial[s.used[q]])
    else:
        put_velocities(s, s.v)
    return True


@compiled
def judge(s: StepArrays) -> float:
    """The residual of the contacts of a group, a part of their largest impulse.

    Beside joints that let nothing press it is, as in rounds, no part of the rounding of these.
    """
    put_velocities(s, s.trial)
    left, largest = 0.0, max(s.least, TINY) if s.row_count > 0 else TINY
    for q in range(s.chosen_count):
        left = max(left, left_at(s, s.chosen[q], s.trial))
        largest = max(largest, impulse_of(s, s.chosen[q]))
    s.residual = left / largest
    return s.residual


@compiled
def sweep(s: StepArrays, sweeps: int, tolerance: float, relax: float) -> None:
    """Sweeps of Gauss-Seidel over the contacts of a group."""
    put_velocities(s, s.v)
    for q in range(s.chosen_count):
        c = s.chosen[q]
        s.rim[c] = 0.0 if s.kind[c] == CONE else rim_of(s, c, s.x, s.y)
    sweep_bodies(s.chosen[: s.chosen_count], s.bodies, s.J, s.moved, s.own, s.bias, s.kind,
                 s.under, s.mu, s.rim, s.x, s.v, sweeps, 0.1 * tolerance, relax)  # fmt: skip


@compiled
def finish(s: StepArrays, tolerance: float) -> bool:
    """Newton's method behind sweeps; more of these where it does not end."""
    done, sweeps, relax, least = SWEEPS, SWEEPS, RELAX, 1e300
    while judge(s) > tolerance:
        relax = relax if s.residual < least else 1.0
        least = min(least, s.residual)
        if tolerance < NEAR:
            if not lay_out(s, s.dense_size):
                return False
            newton(s, tolerance, False)
        if judge(s) <= tolerance or done >= MOST_SWEEPS:
            break
        if tolerance < NEAR:  # rounds of Newton's method cost more
            sweeps = done
        sweep(s, sweeps, tolerance, relax)
        done += sweeps
    return True


@compiled
def refine_held(s: StepArrays, tolerance: float, aim: float) -> bool:
    """Improve impulses by sweeps, then Newton's method, to a tolerance; False without room."""
    m, best = s.chosen_count, s.residual
    copy_impulses(s.x, s.y, s.kept, s.y_kept, s.contact_count)
    for _ in range(HELD_ROUNDS):
        if not reduced.factor_joints(s):
            return False
        reduced.put_felt(s, ANSWERED)
        for p in range(m):
            c = s.chosen[p]
            own = s.own_held[c]
            for r in range(3):
                for q in range(3):
                    own[3 * r + q] = s.felt[3 * p + r, 3 * p + q]
            felt = own[0] if s.kind[c] == CONE else own[0] + own[4] + own[8]
            own[0] = 0.0 if felt * s.r[c] < HELD else max(own[0], TINY)
        for _ in range(MET):
            reduced.meet_joints(s)
        put_velocities(s, s.v)
        for p in range(m):
            c = s.chosen[p]
            put_speeds(s, c, s.v)
            s.rim[c] = 0.0 if s.kind[c] == CONE else rim_of(s, c, s.x, s.y)
        sweep_contacts(s.chosen[:m], s.felt, s.own_held, s.u, s.kind, s.under, s.mu, s.rim,
                       s.x, SWEEPS, aim)  # fmt: skip
        for _ in range(MET):
            reduced.meet_joints(s)
        if not lay_out(s, s.dense_size):
            return False
        s.residual = newton(s, aim, False)
        if s.residual < best:
            best = s.residual
            copy_impulses(s.x, s.y, s.kept, s.y_kept, s.contact_count)
        else:
            copy_impulses(s.kept, s.y_kept, s.x, s.y, s.contact_count)
            s.residual = best
        if best <= tolerance:
            break
    return True


# ------------------------------------------------------------------ rounds


@compiled
def newton(s: StepArrays, tolerance: float, is_reduced: bool, raises: bool = False) -> float:
    """Improve the impulses x and y of a group; the residual.

    is_reduced: by the problem of contacts alone, by what ``factor_joints`` has left. raises: rounds
    that help little ask for a larger weight.
    """
    if is_reduced:
        reduced.meet_joints(s)
    else:
        put_velocities(s, s.v)
    left, weight, s.factored = residual_of(s, s.v, 0.0), WEIGHT, 0.0
    most = MOST_WEIGHT if is_reduced else WEIGHT
    if is_reduced and left > tolerance:
        weight = ALONE_WEIGHT
        reduced.put_felt(s, 1)
    for _ in range(ROUNDS):
        if left <= tolerance:
            break
        inner = INNER * max(0.1 * tolerance, min(left, 1e-3))
        if is_reduced:
            weight = reduced.reduced_round(s, weight, inner)
        else:
            solve_round(s, weight, inner)
            exchange(s)
        new = residual_after(s, is_reduced)
        helps = new <= HELPS * left
        if helps and is_reduced:
            weight = most
        elif helps or (raises and new < WORSE * left and weight < MOST_WEIGHT):
            weight = min(weight / reduced.LESS, max(most, weight) if helps else MOST_WEIGHT)
        else:
            weight *= reduced.LESS
        if new >= (WORSE if raises else 1.0) * left:
            exchange(s)
            put_velocities(s, s.v)
        else:
            left = new
        if weight < reduced.LEAST or (left <= SETTLED and not helps and not is_reduced):
            break
    if is_reduced:  # joints are met by velocities that their impulses give but for rounding
        put_velocities(s, s.v)
        left = residual_of(s, s.v, 0.0)
    return left


@compiled
def residual_after(s: StepArrays, is_reduced: bool) -> float:
    """The residual of a round; where masses carried count at its own velocities.

    Those of impulses have the rounding of these, which moves a link of hardly any mass far.
    """
    if is_reduced:
        return residual_of(s, s.v, 0.0)
    if s.carries == 0:
        put_velocities(s, s.trial)
        return residual_of(s, s.trial, 0.0)
    left = 0.0
    for q in range(s.used_count):
        for k in range(6):
            left = max(left, abs(s.rest[s.used[q], k]))
    return residual_of(s, s.v, left)


@compiled
def exchange(s: StepArrays) -> None:
    """Exchange the impulses x and y with those that were tried."""
    for q in range(s.chosen_count):
        x, push = s.x[s.chosen[q]], s.push[s.chosen[q]]
        for k in range(3):
            x[k], push[k] = push[k], x[k]
    for n in range(s.row_count):
        k = s.rows[n]
        s.y[k], s.pull[k] = s.pull[k], s.y[k]


# ------------------------------------------------------------------ groups


@compiled
def root_of(parent: Integers, b: int) -> int:
    """The least body of a group; ways to it become shorter."""
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    return b


@compiled
def is_in_turn(s: StepArrays, c: int) -> bool:
    """True if a contact is of the problem that is solved: in a round of an impact if it answers."""
    return s.turn == 0 or s.takes[c] == s.turn


@compiled
def find_groups(s: StepArrays) -> None:
    """Find the group of each contact, by its least body, and in ``parent`` those of bodies.

    In a round of an impact contacts that take part alone connect.
    """
    for b in range(s.parent.size):
        s.parent[b] = s.machine[b]
    for c in range(s.contact_count):
        i, j = s.bodies[c, 0], s.bodies[c, 1]
        if i > 0 and j > 0 and is_in_turn(s, c):
            i, j = root_of(s.parent, i), root_of(s.parent, j)
            s.parent[max(i, j)] = min(i, j)
    for c in range(s.contact_count):
        s.group[c] = root_of(s.parent, max(s.bodies[c, 0], s.bodies[c, 1]))


@compiled
def list_groups(s: StepArrays) -> None:
    """Find the groups, and list what each has; choose none."""
    find_groups(s)
    for b in range(s.place.size):
        s.place[b] = s.first[b, BODY] = s.first[b, CONTACT] = s.first[b, ROW] = -1
    s.used_count = 0
    for b in range(s.place.size - 1, 0, -1):
        g = root_of(s.parent, b)
        s.next_body[b], s.first[g, BODY] = s.first[g, BODY], b
    for c in range(s.contact_count - 1, -1, -1):
        if is_in_turn(s, c):
            g = s.group[c]
            s.next_contact[c], s.first[g, CONTACT] = s.first[g, CONTACT], c
    for k in range(s.y.size - 1, -1, -1):
        g = root_of(s.parent, s.row_owner[k])
        s.next_row[k], s.first[g, ROW] = s.first[g, ROW], k


@compiled
def choose(s: StepArrays, group: int) -> None:
    """Take the bodies, contacts and rows of a group, as listed."""
    for q in range(s.used_count):
        s.place[s.used[q]] = -1
    s.used_count = s.chosen_count = s.row_count = 0
    b, c, k = s.first[group, BODY], s.first[group, CONTACT], s.first[group, ROW]
    while b >= 0:
        s.used[s.used_count], s.place[b] = b, s.used_count
        s.used_count += 1
        b = s.next_body[b]
    while c >= 0:
        s.chosen[s.chosen_count] = c
        s.chosen_count += 1
        c = s.next_contact[c]
    while k >= 0:
        s.rows[s.row_count] = k
        s.row_count += 1
        k = s.next_row[k]
