"""The one algorithm of all explicit Runge-Kutta methods: a compiled loop that can stop and go on.

It knows a vector y and first-class functions ``f(t, y, out, system, loops)``:

    rhs      out = dy/dt
    project  moves y onto its constraints in place; on entry out[0] = 1 tells that rhs was the last
             one called, at this very t and y. Then out[0] = 1 where y changed by more than the
             rounding of a normalisation, out[1] = 1 where that failed, 2 where the state is too
             close to a singular one to go on from; out[4:] = lengths that go linearly through zero
             at a singular state
    report   out = what else is reported at (t, y): accelerations, multipliers, ...
    accepted (only where something is watched) takes note of an accepted state
    watch    (only where there are switches) gives their values (stepping/event_location.py)

Everything that decides what comes next lies in the arrays of ``Work``: however a run is cut into
calls of ``advance``, its numbers are the same bit for bit. Source: Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I (HNW), II.4 to II.6.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from collections.abc import Sequence
from typing import Any

from dap3d_core.integrators.runge_kutta.tableau import ABSCISSA, Floats, Integers
from dap3d_core.integrators.stepping.event_location import (
    end_is_across,
    next_length,
    sample,
    settle,
)
from dap3d_core.integrators.stepping.integration_state import (
    ACROSS,
    CALM,
    DENSE,
    ERROR_SIZE,
    ERROR_USES_RESULT,
    ERRORS,
    FRESH,
    H_DENSE,
    LAST_REJECTED,
    LENGTHS,
    LIMIT,
    NEXT,
    NOT_FINITE,
    OTHER,
    OUTCOME,
    POOR,
    PROJECT_ON,
    REJECTED,
    RHS,
    RTOL,
    RUNNING,
    SCRATCH,
    STAGES,
    STATUS,
    STEP,
    STEP_FLOOR,
    STEPS,
    SWITCHES,
    T_DENSE,
    T_STOP,
    TRIAL,
    WATCHED,
    Function,
    H,
    T,
    Work,
    Y,
)
from dap3d_core.integrators.stepping.output import (
    POOR_PLACE,
    dense_state,
    may_step,
    project_state,
)
from dap3d_core.integrators.stepping.rounding import note_failure, watch_rounding
from dap3d_core.integrators.stepping.singular_poses import (
    aim,
    is_near,
    look_ahead,
    look_back,
    singular_ahead,
)
from dap3d_core.integrators.stepping.step_control import (
    LARGEST,
    accept,
    beyond_rounding,
    end_of_step,
    error_norm,
    first_step,
    joined,
    reject,
    shrinkage,
    step_floor,
)
from dap3d_core.integrators.stepping.stiffness import watch_stiffness
from dap3d_core.integrators.stepping.vector_ops import all_finite, combine, copy, scaled_largest
from dap3d_core.kernels.runtime.cache import compiled, compiled_inside

#: Factor on a step that met a number that is not finite, or whose end could not be projected.
RETREAT = 0.1
#: What ``land`` says, besides a status: the step was cut.
ACROSS_A_SWITCH = -1
#: Factor on a step that should end elsewhere, and how often in a row that is tried.
ELSEWHERE, ATTEMPTS = 0.6, 4

#: Near a singular state nothing is known better than to this part of the largest component.
BLURRED = 1e-11
#: Projection may move a result by this part of it, and no more: the error of what it takes away
#: tells of no other branch.
JUMP = 1e-2
#: An error up to this may be rounding.
ROUNDED = 100.0


@compiled
def advance(
    work: Work, functions: Sequence[Function], system: Any, loops: Any, budget: int
) -> None:
    """Go on until more than ``budget`` calls of rhs are spent, the rows are full, or the run ends.

    At least one step is tried in each call, whatever the budget.
    """
    rhs, project, report = functions[0], functions[1], functions[2]
    real, integer = work.real, work.integer
    watch = functions[4] if integer[SWITCHES] != 0 else rhs
    limit = integer[RHS] + budget
    while may_step(work, dense_state, limit, project, report, system, loops):
        steps, rejected = integer[STEPS], integer[REJECTED]
        h = real[H]
        step(work, rhs, project, watch, system, loops)
        watch_rounding(work, work.k[0], h, rejected, rhs, system, loops)
        if integer[WATCHED] != 0 and integer[STEPS] > steps:
            functions[3](real[T], work.state[Y], real[OUTCOME:], system, loops)


@compiled_inside
def step(
    work: Work, rhs: Function, project: Function, watch: Function, system: Any, loops: Any
) -> None:
    """Try one step: accept it, reject it, or stop the run."""
    real, integer, times, k, y = work.real, work.integer, work.times, work.k, work.state[Y]
    if integer[FRESH] == 0:
        integer[RHS] += 1
        rhs(real[T], y, k[0], system, loops)
        integer[FRESH] = 1
        if not all_finite(k[0]):
            real[T_STOP], integer[STATUS] = real[T], NOT_FINITE
            return
    adaptive = real[STEP] == 0.0
    if adaptive and real[H] == 0.0:
        real[H] = first_step(real, integer, times, y, k, work.state[SCRATCH], work.tolerance, rhs,
                             system, loops)  # fmt: skip
    end = t1 = end_of_step(real, integer, times)
    longest = t1 - real[T]
    h = aim(work.lengths, real[CALM], longest) if adaptive else longest
    if integer[SWITCHES] != 0 or real[LIMIT] < t1:
        h = min(h, next_length(work, t1, k[0], project, watch, system, loops))
        if h == 0.0:
            return
    if h < longest:
        t1 = real[T] + h
    near = integer[PROJECT_ON] != 0 and is_near(work.lengths, longest)
    if not take_stages(work, t1, h, near, rhs, project, watch, system, loops):
        return
    error = 0.0
    if adaptive and near:
        error = kept_error(work, t1, h, project, system, loops)
    elif adaptive:
        error = error_norm(real, integer, work.state, k, work.table, work.tolerance, h)
    if 1.0 < error <= LARGEST:
        error = judged(work, near, h, error)
    if error <= 1.0:
        failure = land(work, t1, near, rhs, project, watch, system, loops)
        if failure == ACROSS_A_SWITCH:
            return
        if failure == RUNNING and adaptive and not near and is_poor(real, integer, times, t1):
            integer[POOR] += 1
            look_ahead(work.lengths, real[LENGTHS:], h)
            shorter = h if aim(work.lengths, real[CALM], h) < h else h * ELSEWHERE
            reject(real, integer, times, t1, shorter, STEP_FLOOR)
        elif failure == RUNNING:
            integer[POOR] = 0
            if singular_ahead(work.lengths, h) < h:
                real[ACROSS] = 0.0
            look_back(work.lengths, real[LENGTHS:], h)
            accept(real, integer, times, work.state, k, t1, error)
            settle(work, h, longest, end)
        else:
            reject(real, integer, times, t1, h * RETREAT, failure)
    elif error <= LARGEST:
        note_failure(real, integer, error, h, integer[LAST_REJECTED] != 0)
        reject(real, integer, times, t1, h * shrinkage(real, error), STEP_FLOOR)
    else:
        reject(real, integer, times, t1, h * RETREAT, NOT_FINITE)


@compiled_inside
def judged(work: Work, near: bool, h: float, error: float) -> float:
    """The error of a step that is too large, but for what a shorter step could not do better."""
    real, integer = work.real, work.integer
    if near:
        return 1.0 if is_rounding(real, work.lengths, h, error) else error
    if h * shrinkage(real, error) < step_floor(real, work.times):
        return min(
            error, beyond_rounding(real, integer, work.state, work.k, work.table, work.tolerance, h)
        )
    return error


@compiled_inside
def take_stages(
    work: Work,
    t1: float,
    h: float,
    near: bool,
    rhs: Function,
    project: Function,
    watch: Function,
    system: Any,
    loops: Any,
) -> bool:
    """Stages and trial state of a step to t1; each on the constraints if ``near``.

    False where one of them lies beyond a switch.
    """
    real, integer, k, table = work.real, work.integer, work.k, work.table
    stages, watched = integer[STAGES], integer[SWITCHES] != 0
    last = stages if integer[ERROR_USES_RESULT] != 0 else stages - 1
    for i in range(1, stages + 1):
        x = work.state[TRIAL] if i == stages else work.state[SCRATCH]
        combine(x, 1.0, work.state[Y], h, table, i, k)
        if i <= last:
            c = table[i, ABSCISSA]
            t = t1 if c == 1.0 else real[T] + c * h
            if near:
                on_constraints(work, t, x, project, system, loops)
                x = work.state[SCRATCH]
            if watched and sample(work, t, x, watch, system, loops):
                return False
            integer[RHS] += 1
            rhs(t, x, k[i], system, loops)
    return True


@compiled_inside
def on_constraints(
    work: Work, t: float, x: Floats, project: Function, system: Any, loops: Any
) -> None:
    """The state x of a stage, projected, into the scratch row (x may be that row)."""
    argument = work.state[SCRATCH]
    copy(argument, x)
    project_state(work.real, work.integer, t, argument, project, system, loops)


@compiled_inside
def kept_error(
    work: Work, t1: float, h: float, project: Function, system: Any, loops: Any
) -> float:
    """The error of a step as ``error_norm`` has it, but of the projected result.

    Near a singular state errors are large in a direction that projection takes away, up to rounding
    over the square of the distance: below BLURRED nothing is asked for.
    """
    real, integer, table, k = work.real, work.integer, work.table, work.k
    y, trial, result, other = (work.state[Y], work.state[TRIAL], work.state[SCRATCH],
                               work.state[OTHER])  # fmt: skip
    on_constraints(work, t1, trial, project, system, loops)
    jump = 0.0
    for i in range(integer[ERROR_SIZE]):
        ratio = abs(result[i] - trial[i]) / (JUMP * (1.0 + max(abs(y[i]), abs(result[i]))))
        if not ratio <= jump:
            jump = ratio
    if not jump <= 1.0:
        return jump
    least, main = 0.0, 0.0
    for i in range(integer[ERROR_SIZE]):
        least = max(least, BLURRED * abs(y[i]))
    for e in range(integer[ERRORS]):
        combine(other, 1.0, trial, -h, table, k.shape[0] + e, k)
        project_state(real, integer, t1, other, project, system, loops)
        for i in range(other.size):
            other[i] -= result[i]
        size = scaled_largest(
            other, y, result, integer[ERROR_SIZE], real[RTOL], work.tolerance, h, least
        )
        main = size if e == 0 else joined(main, size)
    return main


@compiled_inside
def is_rounding(real: Floats, lengths: Floats, h: float, error: float) -> bool:
    """Whether the error of a step across a singular state is rounding: a shorter one had no less.

    It is mostly in the direction that projection takes away from there on.
    """
    if not (singular_ahead(lengths, h) < h and error < ROUNDED):
        return False
    before, real[ACROSS] = real[ACROSS], error
    return before > 0.0 and error > 0.25 * before


@compiled_inside
def is_poor(real: Floats, integer: Integers, times: Floats, t1: float) -> bool:
    """Whether a step should end elsewhere: project found the state close to a singular one.

    From there every next step would be inaccurate, while from some way before it one can step
    across. A run that stays close to a singular state is not held up: after a few attempts the
    landing is taken.
    """
    return real[OUTCOME + 1] == POOR_PLACE and integer[POOR] < ATTEMPTS and t1 < times[-1]


@compiled_inside
def land(
    work: Work,
    t1: float,
    near: bool,
    rhs: Function,
    project: Function,
    watch: Function,
    system: Any,
    loops: Any,
) -> int:
    """Prepare dense output, evaluate f, project the trial state; why that failed, or RUNNING.

    Dense output belongs to the step as the method took it; what it gives is projected by itself.
    f is evaluated before the projection, which then has less to do. Where that moves the state by
    no more than the step's error may be, the next step starts with the value all the same.
    """
    real, integer, times, k = work.real, work.integer, work.times, work.k
    y, trial, result = work.state[Y], work.state[TRIAL], integer[STAGES]
    known, watched = integer[ERROR_USES_RESULT] != 0, integer[SWITCHES] != 0
    here, controlled = known and not near, real[STEP] == 0.0 and not near
    if integer[DENSE] != 0 and times[integer[NEXT]] < t1:
        t, argument, table = real[T], work.state[SCRATCH], work.table
        if not known:
            integer[RHS] += 1
            rhs(t1, trial, k[result], system, loops)
            known = True
        for i in range(result + 1, k.shape[0]):
            at = t + table[i, ABSCISSA] * (t1 - t)
            combine(argument, 1.0, y, t1 - t, table, i, k)
            if near:
                on_constraints(work, at, argument, project, system, loops)
            if watched and sample(work, at, argument, watch, system, loops):
                return ACROSS_A_SWITCH
            rhs(at, argument, k[i], system, loops)
        integer[RHS] += k.shape[0] - 1 - result
        here = here and k.shape[0] == result + 1
        prepare_dense(real, integer, work.state, k, work.terms, table, t1)
    if controlled and not known and t1 < times[-1]:
        integer[RHS] += 1
        rhs(t1, trial, k[result], system, loops)
        known = here = True
    if controlled and known:
        watch_stiffness(work, t1 - real[T])
    copy(work.state[OTHER], trial)
    failure = project_state(real, integer, t1, trial, project, system, loops, here)
    if failure != RUNNING:
        return failure
    if known and real[OUTCOME] != 0.0:
        known = controlled and is_within_error(work)
    if not known and (watched or t1 < times[-1]):
        integer[RHS] += 1
        rhs(t1, trial, k[result], system, loops)
        known = True
    if known and not all_finite(k[result]):
        return NOT_FINITE
    if watched and end_is_across(work, t1, k[result], watch, system, loops):
        return ACROSS_A_SWITCH
    integer[FRESH] = 1 if known else 0
    return RUNNING


@compiled_inside
def is_within_error(work: Work) -> bool:
    """Whether the trial state is as near to the other one as the error of a step may be."""
    real, y, trial, other = work.real, work.state[Y], work.state[TRIAL], work.state[OTHER]
    for i in range(other.size):
        other[i] -= trial[i]
    size = work.integer[ERROR_SIZE]
    return scaled_largest(other, y, trial, size, real[RTOL], work.tolerance, 0.0) <= 1.0


@compiled_inside
def prepare_dense(
    real: Floats,
    integer: Integers,
    state: Floats,
    k: Floats,
    terms: Floats,
    table: Floats,
    t1: float,
) -> None:
    """Terms of the dense output from t to t1, HNW II.6, from all stages."""
    h, result = t1 - real[T], integer[STAGES]
    for i in range(state.shape[1]):
        rise = state[TRIAL, i] - state[Y, i]
        terms[0, i] = state[Y, i]
        terms[1, i] = rise
        terms[2, i] = h * k[0, i] - rise
        terms[3, i] = rise - h * k[result, i] - terms[2, i]
    first = k.shape[0] + integer[ERRORS]
    for row in range(4, terms.shape[0]):
        combine(terms[row], 0.0, state[Y], h, table, first + row - 4, k)
    real[T_DENSE], real[H_DENSE] = real[T], h
