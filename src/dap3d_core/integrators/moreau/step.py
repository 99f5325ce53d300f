"""One step: motion without contacts, impulses, moves; compiled, it stops where room is missing."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.arrays import System, coordinate_offset
from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.integrators.moreau import contact_set, free_motion, impulses, restitution
from dap3d_core.integrators.moreau.arrays import CONE, STAYS, WHOLE, StepArrays
from dap3d_core.integrators.moreau.newton import product_of, speed_of
from dap3d_core.integrators.moreau.problem import NEAR, prepare_problem, solve
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.output import may_step, project_state
from dap3d_core.integrators.stepping.step_control import count_turns, end_of_step
from dap3d_core.integrators.stepping.vector_ops import all_finite
from dap3d_core.interface.contacts.rows import FAR_APART
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Way within a step, as a part of the scene's length, below which rows turn by next to nothing: as
#: of piles at rest, whose speeds are those that their residual leaves.
TURNING = 1e-6
#: Passes that remove overlaps.
PASSES = 8
#: Parts of a step by which times differ that are meant to be one.
SAME_TIME = 1e-9
#: Steps between two passes of an estimate of the rate of forces. Of this over the rate are steps
#: at most: what contacts give bodies is known to their forces in the step that follows. Parts of a
#: step at most.
RENEWED, FOLLOWED, MOST_STEPS = 3, 2.0, 100
#: Margin of contacts, as parts of the way of a step, and m of a scene of ordinary size.
MARGIN, LEAST_MARGIN = 1.2, 1e-6
#: Gaps and overlaps, m of a scene of ordinary size, of what contacts carry and joints have moved: a
#: pass that removes overlaps may leave them for the next step.
MOVED_BY_JOINTS = 1e-9
#: What moves by a way x leaves of an overlap x^2 / (2 R), R a tenth of the scene's length: this
#: times x^2 over the length. The next step sees what is left.
BENDS = 5.0
#: Times that joints are fitted to the velocities found, where these leave a residual.
FITS = 3
#: Stages of a step that waits for room: the trial state is that without contacts; it is that where
#: bodies have moved to, but may overlap; forces at the start are yet to be found, before the steps
#: or for a row alone, with no step.
FREE, MOVED, START, START_ALONE = 1, 2, 3, 4


@compiled
def advance(
    work: Any, s: StepArrays, functions: Any, system: System, loops: Any, budget: int
) -> None:
    """Integrate until more than ``budget`` calls of rhs are spent, or the rows are full.

    Or room is missing: ``stage`` says so.
    """
    limit = work.rhs_count + budget
    if s.stage == 0 and work.next_report == 0 and work.status == at.RUNNING and s.is_exported == 0:
        s.stage = START
    if s.stage >= START:
        is_alone = s.stage == START_ALONE
        has_room = push_at_start(work, s, functions[0], system, loops)
        s.stage = 0 if has_room or s.is_exported != 0 else s.stage
        if is_alone or not has_room:
            return
    while s.stage != 0 or goes_on(work, s, functions, system, loops, limit):
        if s.stage == 0:
            fly(work, s, functions[0], system, loops)
            s.stage = FREE
            if not all_finite(work.state[at.TRIAL]):
                work.t_stop, work.status, s.stage = s.t1, at.NOT_FINITE, 0
                return
        if s.stage == FREE:
            if not meet(work, s, system, loops):
                break  # with a status, or for room
            if s.is_solved != 0:
                carry_on(work, s)
            s.stage = MOVED
        if s.is_solved != 0 and not part(work, s, system, loops):
            break
        s.stage = 0
        finish(work, s, functions, system, loops)
    if s.stage != 0 and s.is_exported != 0:
        work.t_stop, work.status, s.stage = s.t1, at.NO_ROOM, 0


@compiled
def push_at_start(work: Any, s: StepArrays, rhs: Function, system: System, loops: Any) -> bool:
    """Find what contacts push with in the first step, for reports at the start; False without room.

    The step is not taken, and begins later as if nothing had been found.
    """
    count, row = work.rhs_count, work.next_report
    work.next_report, work.step_limit = 1, math.inf
    fly(work, s, rhs, system, loops)
    has_room = not all_finite(work.state[at.TRIAL]) or meet(work, s, system, loops)
    work.rhs_count, work.next_report = count, row
    work.segment_step_count, work.largest_residual = 0, 0.0
    return has_room


@compiled
def fly(work: Any, s: StepArrays, rhs: Function, system: System, loops: Any) -> None:
    """Take a step without contacts, as the trial state; the first one remembers nothing."""
    if work.step_count == 0:
        work.rate = work.last_rate = 0.0
        for array in (work.direction, work.pulls):
            zero(array)
        impulses.forget(work.memory, 0)
    renews = work.step_count % RENEWED == 0
    if renews:
        work.rate = free_motion.largest_rate(work, s, rhs, system, loops)
    s.t1 = next_end(work)
    s.h = s.t1 - work.t
    free_motion.move_freely(work, s, renews, rhs, system, loops)


@compiled
def next_end(work: Any) -> float:
    """The time at which the step that comes next ends.

    A limit that rounding alone keeps from it makes no step, whose forces would be rounding.
    """
    t, t1, limit = work.t, end_of_step(work), work.step_limit
    t1 = max(t1, limit) if abs(limit - t1) <= SAME_TIME * (t1 - t) else min(t1, limit)
    rate = min(MOST_STEPS / work.fixed_step, work.rate / FOLLOWED)
    parts = math.ceil((t1 - t) * rate - SAME_TIME)
    return t + (t1 - t) / parts if parts > 1 else t1


@compiled
def goes_on(
    work: Any, s: StepArrays, functions: Any, system: System, loops: Any, limit: int
) -> bool:
    """Report what is reached; True if a step is to be taken now."""
    if s.log_count + 2 * s.met_count > s.log.shape[0] and s.is_exported == 0:
        return False
    first = work.row_count
    again = may_step(work, state_at, limit, functions[1], functions[2], system, loops)
    for q in range(first, work.row_count):
        impulses.put_means(work, s, work.rows[q])
        if s.is_exported == 0:
            impulses.log_contacts(work, s, work.rows[q, 0])
    return again


@compiled
def state_at(work: Any, t: float, y: Floats) -> None:
    """The state reached: steps end where something is reported."""
    copy(y, work.state[at.Y])


@compiled
def meet(work: Any, s: StepArrays, system: System, loops: Any) -> bool:
    """Find impulses of contacts, and velocities ``end`` behind them; False without room."""
    y, trial, n = work.state[at.Y], work.state[at.TRIAL], s.mass.size - 1
    free_motion.take_velocities(y, n, s.before)
    free_motion.take_velocities(trial, n, s.end)
    free_motion.take_velocities(trial, n, s.free)
    for b in range(1, n + 1 if work.pushed[0, 0] != 0.0 else 1):
        for k in range(6):
            s.free[b, k] -= s.h * work.pushed[b, k]
    put_margins(s)
    if not contact_set.find_contacts(work.t, y, FAR_APART, s, system, loops):
        return False
    if work.step_count == 0:
        work.overlap_at_start = deepest_of(s)
        for c in range(s.touch_count):
            if -s.gap[c] == work.overlap_at_start:
                work.overlap_key = 1.0 * s.key[c]
    else:  # what the projection of the last step has left
        work.deepest = max(work.deepest, deepest_of(s))
    s.is_solved = s.met_count = 0
    if s.contact_count == 0 and work.pushed[0, 0] == 0.0:
        for b in range(n + 1):
            copy(s.end[b], s.free[b])
        return True
    impulses.order_memory(work.memory, s.slots)
    any_collides = restitution.put_bias(s, work.memory)
    passes_on = any_collides and restitution.choose_struck(s)
    if s.declared_law.size > 0 and not contact_set.find_grips(work.t, s, system, loops):
        work.t_stop, work.status, s.stage = work.t, at.DRIVEN, 0
        return False
    turns = stay_closed(work, s)
    if not turn_contacts(work, s, any_collides, turns, system, loops):
        return False
    for c in range(s.touch_count if s.resistance_count > 0 else 0):
        contact_set.put_resistances(c, s)
    if passes_on:
        impulses.recall(work, s)  # coefficients of friction
        if not restitution.pass_on(s, work.rtol):
            return False
    if not solve_fitted(work, s, turns, passes_on, system, loops):
        return False
    if any_collides:
        restitution.put_flies(s)
        if not restitution.limit_bounces(s, work.rtol):
            return False
    s.is_solved = 1
    work.largest_residual = max(work.largest_residual, s.residual)
    impulses.remember(work, s)
    impulses.keep_for_reports(s)
    for b in range(n + 1):
        copy(s.end[b], s.v[b])
    return True


@compiled
def turn_contacts(
    work: Any, s: StepArrays, any_collides: bool, turns: bool, system: System, loops: Any
) -> bool:
    """Take rows of what collides at its instant, others halfway if any turns; False without room.

    Normals of the start of the step made oblique impacts of the first order.
    """
    if any_collides:
        struck = free_motion.put_struck(work, s)
        if not contact_set.turn_rows(work.t, struck, True, s, system, loops):
            return False
        restitution.renew_bias(s, work.memory)
    if turns:
        t, middle = work.t + 0.5 * s.h, free_motion.put_middle(work, s)
        return contact_set.turn_rows(t, middle, False, s, system, loops)
    if not any_collides and s.declared_gap.size == 0 and s.y.size > 0:
        contact_set.evaluate_rows(work.t, work.state[at.Y], False, s, system, loops)
    return True


@compiled
def solve_fitted(
    work: Any, s: StepArrays, turns: bool, passes_on: bool, system: System, loops: Any
) -> bool:
    """Solve the step's problem; False without room.

    turns: with rows halfway through the step. passes_on: behind rounds of an impact.
    """
    for k in range(s.y.size):
        s.free_speed[k] = speed_of(s, k, s.free)
    left = FITS if s.y.size > 0 else 0
    impulses.recall(work, s)
    if passes_on:
        restitution.recall_rounds(s)
    while True:
        prepare_problem(s)
        if passes_on:
            restitution.widen(s, restitution.WIDER)
        has_room = solve(s, work.rtol)
        if passes_on:
            restitution.widen(s, 1.0 / restitution.WIDER)
        if not has_room:
            return False
        if not impulses.let_slip(s):
            if s.residual <= work.rtol or left == 0:
                return True
            left -= 1
            free_motion.fit_joints(work, s, turns, system, loops)
            impulses.recall(work, s)


@compiled
def carry_on(work: Any, s: StepArrays) -> None:
    """Move the bodies that contacts or joints act on as they do, as the trial state."""
    y, trial, h, goes = work.state[at.Y], work.state[at.TRIAL], s.h, s.queue
    restitution.put_falls(s)
    restitution.mark_moved(work, s, goes)
    for b in range(1, s.end.shape[0]):
        c, d = coordinate_offset(b), s.trial[b]
        for k in range(6):
            d[k] = restitution.mean_of(s, b, k)
        if goes[s.machine[b]] == 0:
            copy(d, s.path[b])
            continue
        for k in range(7):
            trial[c + k] = y[c + k]
        free_motion.move(trial, c, h * d[0], h * d[1], h * d[2], h * d[3], h * d[4], h * d[5])
    trial[trial.size - 1] += work_done(work, s)
    keep_pushed(work, s)


@compiled
def keep_pushed(work: Any, s: StepArrays) -> None:
    """Keep the accelerations that contacts have given; those of impacts do not go on.

    A step is steady where these are expected ones, by which bodies have gone in free motion.
    """
    s.is_steady = 1 if work.pushed[0, 0] != 0.0 else 0
    work.pushed[0, 0] = 0.0
    for b in range(1, s.end.shape[0]):
        s.is_steady = 0 if s.hit[b] != restitution.NOT_HIT else s.is_steady
        for k in range(6):
            change = s.end[b, k] - s.free[b, k] if s.hit[b] == restitution.NOT_HIT else 0.0
            s.change[k] = change - s.h * work.pushed[b, k]
            work.pushed[b, k] = change / s.h
            if change != 0.0:
                work.pushed[0, 0] = 1.0
        way = s.h * (length_of(s.change, 0) + s.length * length_of(s.change, 3))
        s.is_steady = 0 if way > TURNING * s.length else s.is_steady


@compiled
def put_margins(s: StepArrays) -> None:
    """How near bodies have to be, m, to touch within the step."""
    least = LEAST_MARGIN * s.length
    s.margin[0] = 0.0
    for b in range(1, s.margin.size):
        speed = max(length_of(s.before[b], 0), length_of(s.free[b], 0))
        spin = max(length_of(s.before[b], 3), length_of(s.free[b], 3))
        s.margin[b] = MARGIN * s.h * (speed + spin * s.shape_reach[b]) + least


@compiled
def length_of(v: Floats, k: int) -> float:
    """Length of three numbers from k on."""
    return math.sqrt(v[k] * v[k] + v[k + 1] * v[k + 1] + v[k + 2] * v[k + 2])


@compiled
def deepest_of(s: StepArrays) -> float:
    """The largest overlap of the contacts found, m."""
    least = 0.0
    for c in range(s.contact_count):
        least = min(least, s.gap[c])
    return -least


@compiled
def stay_closed(work: Any, s: StepArrays) -> bool:
    """Mark the contacts that stay closed and move, by velocities ``end`` expected; True if any.

    Those of the first step are the ones of before: slip that begins there is not a step late.
    What joints have moved a contact that pushed by is taken back: gaps to one side alone would
    ask of a body that several contacts carry what none of them allows.
    """
    found, least, begins = False, TURNING * s.length, work.step_count == 0
    for b in range(1, s.end.shape[0]):
        for k in range(6):
            after = s.free[b, k] + s.h * work.pushed[b, k]
            s.end[b, k] = s.before[b, k] if begins else after
    mark_moved_apart(s)
    for c in range(s.law_count):
        i, j = s.bodies[c, 0], s.bodies[c, 1]
        if s.kind[c] != CONE or s.collides[c] != 0:
            continue
        if begins:
            a, d, e = contact_set.velocity_of(s, c, s.before)
            rests = max(abs(a), abs(d), abs(e)) * s.h <= least
            if not rests or abs(s.gap[c]) > restitution.OVERLAP * s.length:
                continue
        elif s.slots[impulses.slot_of(work.memory, s.slots, s.key[c])] < 0:
            continue
        moved = s.queue[i] + s.queue[j] > 0 and abs(s.gap[c]) <= MOVED_BY_JOINTS * s.length
        if moved and s.hit[max(i, j)] == restitution.NOT_HIT:
            s.bias[c, 0] = s.gap[c] / s.h
        way = s.h * (speed_at(s, i) + speed_at(s, j))
        if way > least and (begins or is_pushed(work, i) or is_pushed(work, j)):
            s.collides[c], found = STAYS, True
    return found


@compiled
def mark_moved_apart(s: StepArrays) -> None:
    """Mark by 1 the bodies of which a gap that is to close is that of rounding, or of joints."""
    for b in range(s.queue.size):
        s.queue[b] = 0
    for c in range(s.law_count):
        if s.kind[c] == CONE and restitution.OVERLAP < s.gap[c] / s.length <= MOVED_BY_JOINTS:
            s.queue[s.bodies[c, 0]] = s.queue[s.bodies[c, 1]] = 1
    s.queue[0] = 0


@compiled
def is_pushed(work: Any, b: int) -> bool:
    """True if contacts gave a body an acceleration in the last step."""
    found = False
    for k in range(6):
        found |= work.pushed[b, k] != 0.0
    return found and b > 0


@compiled
def speed_at(s: StepArrays, b: int) -> float:
    """How fast a body moves, m/s, its turning at the length of the scene."""
    return length_of(s.end[b], 0) + s.length * length_of(s.end[b], 3)


@compiled
def work_done(work: Any, s: StepArrays) -> float:
    """Work of the impulses behind free motion, J; those of contacts are added to the sums.

    Forces of free motion do work along the means ``trial`` instead of ``path``. An impulse acts at
    the mean of the velocities before and behind it; what contacts bear of the forces of a body that
    they stop, at the velocity behind. Sums are the change of kinetic energy, but for errors of free
    motion, and for how its path differs from that of even forces.
    """
    total, given = 0.0, 0.0
    for b in range(1, s.trial.shape[0]):
        m, spin, mean, first = s.mass[b], s.spin[b], s.trial[b], s.hit[b]
        forced, way, rest, curve = s.turned, s.turned[6:], s.turned[12:], s.turned[18:]
        for k in range(6):
            before, end = s.before[b, k], s.end[b, k]
            free = s.free[b, k] + s.h * work.pushed[b, k]
            forced[k], way[k] = s.free[b, k] - before, mean[k] - s.path[b, k]
            rest[k] = (end if first == restitution.NOT_HIT else before) - free
            curve[k] = 0.5 * (before + free) - s.path[b, k]
            mean[k] = 0.5 * (before + end)
            if first != restitution.NOT_HIT:
                mean[k] += (first - 0.5) * forced[k]
        total += product_of(forced, way, m, spin) + product_of(rest, curve, m, spin)
        if first != restitution.NOT_HIT:
            given += (first - 0.5) * (1.0 - s.flies[b]) * product_of(forced, forced, m, spin)
    for c in range(s.contact_count):
        u0, u1, u2 = contact_set.velocity_of(s, c, s.trial)
        pushed, rubbed = s.x[c, 0] * u0, s.x[c, 1] * u1 + s.x[c, 2] * u2
        if s.kind[c] == WHOLE:
            pushed, rubbed = 0.0, rubbed + pushed
        given += pushed + rubbed
        work.friction_work += rubbed
    work.contact_work += given
    work.work_given += max(given, 0.0)
    total += given
    for k in range(s.y.size):
        total += s.y[k] * speed_of(s, k, s.trial)
    return total


@compiled
def part(work: Any, s: StepArrays, system: System, loops: Any) -> bool:
    """Move bodies that overlap apart, by the least change in the metric of their masses.

    What joints are off by is removed together with that: apart each would undo the other. False
    without room.
    """
    trial, deepest, margin = work.state[at.TRIAL], 0.0, 0.5 * LEAST_MARGIN * s.length
    for b in range(s.margin.size):
        s.margin[b] = margin
    for turn in range(PASSES):
        if not all_finite(trial):  # ``finish`` says so
            break
        if not contact_set.find_contacts(s.t1, trial, 2.0 * margin, s, system, loops):
            return False
        deepest = deepest_of(s)
        if s.contact_count > 0 and s.declared_gap.size == 0 and s.y.size > 0:
            contact_set.evaluate_rows(s.t1, trial, True, s, system, loops)
        enough = (MOVED_BY_JOINTS if turn > 0 and s.y.size > 0 else restitution.OVERLAP) * s.length
        if max(deepest, contact_set.misfit_of(s, system)) <= enough:
            break
        prepare_problem(s)
        for b in range(s.free.shape[0]):
            zero(s.free[b])
        for c in range(s.contact_count):
            s.bias[c, 0], s.mu[c] = s.gap[c], 0.0
            s.x[c, 0] = s.x[c, 1] = s.x[c, 2] = s.bias[c, 1] = s.bias[c, 2] = 0.0
        for k in range(s.y.size):
            s.y[k], s.free_speed[k] = 0.0, -system.residual[system.row[k]]
        if not solve(s, NEAR):
            return False
        way = 0.0
        for b in range(1, s.v.shape[0]):
            v = s.v[b]
            way = max(way, length_of(v, 0) + s.length * length_of(v, 3))
            free_motion.move(trial, coordinate_offset(b), v[0], v[1], v[2], v[3], v[4], v[5])
        if way * (s.residual + BENDS * way / s.length) <= restitution.OVERLAP * s.length:
            deepest = 0.0  # to that
            break
    work.deepest = max(work.deepest, deepest)
    return True


@compiled
def finish(work: Any, s: StepArrays, functions: Any, system: System, loops: Any) -> None:
    """Make the trial state that of the end of the step."""
    y, trial = work.state[at.Y], work.state[at.TRIAL]
    if s.is_solved != 0 and s.is_steady == 0 and s.first_state < y.size:
        free_motion.follow_states(work, s, functions[0], system, loops)
    if s.is_solved != 0:
        free_motion.give_velocities(trial, s.end)
    work.segment_step += 1 if s.t1 >= end_of_step(work) else 0
    copy(work.state[at.OTHER], y)
    copy(y, trial)
    work.t_dense, work.h_dense, work.t = work.t, s.h, s.t1
    work.step_count += 1
    failure = at.RUNNING
    if not all_finite(y):
        failure = at.NOT_FINITE
    elif s.y.size > 0:
        failure = project_state(work, work.t, y, functions[1], system, loops)
    if failure != at.RUNNING:
        work.t_stop, work.status = s.t1, failure
    elif work.calls_accepted != 0:
        count_turns(work, functions[3], system, loops)
