"""The stages of a Radau step by simplified Newton iteration, and its error estimate.

Source: Hairer, Wanner, Solving Ordinary Differential Equations II (HW), IV.8, VII.4, and their code
RADAU. The stages are decoupled by T into one real and one to three complex systems with the same
tangent. Norms are the largest scaled component, as in stepping/step_control.py.
"""

import math
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, System, velocity_offset
from dap3d_core.assembly.evaluate import copy, largest, place, zero
from dap3d_core.assembly.state_update import add_displacement, add_velocity
from dap3d_core.formulations.common.constraints import linearise
from dap3d_core.formulations.stabilized_index2 import stage_equations
from dap3d_core.formulations.stabilized_index2.jacobian import BENT, differentiate
from dap3d_core.formulations.stabilized_index2.state_tangent import differentiate_states
from dap3d_core.integrators.radau import convergence
from dap3d_core.integrators.radau.state import SLOPE, Given, RadauState
from dap3d_core.integrators.radau.tableau import FEWEST
from dap3d_core.integrators.stepping.integration_state import SCRATCH, Y
from dap3d_core.integrators.stepping.step_control import EPSILON, LARGEST
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import is_differentiated, with_slopes
from dap3d_core.linear.lu import factor_lu, solve_lu

#: Iterations at most with 3 stages, more for each further two; more where the step is fixed, for
#: a shorter one is no choice there.
MOST, MORE, MOST_FIXED = 10, 5, 40
#: Slow iterations that a fixed step, or multipliers on their way, are left.
PATIENCE = 5
#: Factors that belong to a step this near the present one are used for it.
SAME_STEP = 1e-3
#: Across a bend changes below this part of the limit have a rate of no more than this: the step may
#: grow, with a new tangent.
UNSEEN_CHANGE, UNSEEN_RATE = 0.1, 2e-3
#: A step whose stages were not found is halved.
UNFOUND = 0.5


@compiled
def find_tangent(work: RadauState, given: Given) -> None:
    """The tangent of the step ``work.tangent_step`` at its end as predicted.

    ``work.tangent_is_current`` is 0 after it where it is not finite.

    The directions of stiff elements change during a step, and of its stages the last one counts
    most: on the governor of A05 the iteration converges 20 times faster than with the tangent at
    the start of the step, three times faster than with that of its middle.
    """
    system, loops, tangent, matrix = given
    argument = work.state[SCRATCH]
    for k in range(argument.shape[0]):
        argument[k] = work.state[Y, k] + work.Z[work.stages - 1, k]
    at = work.t + work.tangent_step if work.has_last_step != 0 else work.t
    place(at, argument, system, loops)
    linearise(at, system, loops)
    stage_equations.keep_state(system, matrix, work.regularisation)
    for k in range(system.multipliers.shape[0]):
        system.multipliers[k] = -work.multipliers[work.stages - 1, 1, k]
    work.jacobian_count += 1
    work.tangent_needed, work.tangent_is_current = 0, 1
    work.factored_step = 0.0
    finite = differentiate(at, system.multipliers, system, loops, tangent)
    if finite and tangent.states.values.shape[0] > 0:
        differentiate_states(at, system, loops, tangent)
        finite = largest(tangent.states.values) < math.inf
    if not finite:
        work.tangent_is_current = 0


@compiled
def method_index(stages: int) -> int:
    """Index of the method of so many stages in the tables of ``RadauMethod``."""
    return (stages - FEWEST) // 2


@compiled
def pair_count(stages: int) -> int:
    """Number of pairs of complex poles."""
    return (stages - 1) // 2


@compiled
def pole(poles: Floats, p: int, h: float) -> Any:
    """Complex pole p of a step h, 1/s; of numpy, with the arithmetic of compiled code."""
    return np.complex128(complex(poles[1 + 2 * p] / h, poles[2 + 2 * p] / h))


@compiled
def factorise_both(t: float, h: float, work: RadauState, given: Given) -> float:
    """``factorise`` on the equations of bodies."""
    return factorise(h, work, given, given[3], fill_stages)


@compiled
def fill_stages(s: Any, K: Any, given: Given) -> None:
    """K = s - J, for real or complex s in 1/s."""
    system, _loops, tangent, matrix = given
    stage_equations.fill_matrix(s, K, system.blocks, matrix, tangent)


@compiled_into
def factorise(h: float, work: RadauState, given: Given, program: Any, fill: Any) -> float:
    """Factors of the real and the complex systems of a step h; 0, or UNFOUND if one is singular.

    program: of elimination, by its tables. fill: as ``fill_stages``.
    """
    poles = work.method.poles[method_index(work.stages)]
    nodes, columns, updates = program.nodes, program.columns, program.updates
    work.factorisation_count += 1
    work.factored_step = h
    fill(poles[0] / h, work.K, given)
    regular = factor_lu(nodes, columns, updates, work.K, work.pivots)
    for p in range(pair_count(work.stages) if regular else 0):
        fill(pole(poles, p, h), work.Kc[p], given)
        regular = regular and factor_lu(nodes, columns, updates, work.Kc[p], work.pivotsc[p])
    if regular:
        return 0.0
    work.factored_step = 0.0
    return UNFOUND


@compiled
def lagrange(c: Floats, stages: int, j: int, u: float) -> float:
    """At u the polynomial that is one at c_j and zero at the other stages."""
    value = 1.0
    for k in range(stages):
        if k != j:
            value *= (u - c[k]) / (c[j] - c[k])
    return value


@compiled
def predict(h: float, work: RadauState, prolong: bool, system: System) -> None:
    """Starting values of the stages: the polynomials of the last step, prolonged (HW IV.8).

    Or the state as it is, where they are not to be prolonged, or there was no step before. But
    where there are contacts, along its slope then: a tangent where slip is zero holds its direction
    so stiffly that the iteration seems to have found the stages, whatever friction turns.

    mu is no smooth function: it has the same values at the stages of each step, but for a power of
    h; where the number of stages has changed it starts from zero. Nor is lambda prolonged where
    there are contacts, which may share it while their friction depends on it: what rows do not tell
    apart no iteration corrects, and from step to step its rounding would grow.
    """
    keeps = system.contacts.shape[0] > 0
    stages, old, now = work.Z, work.Z_old, work.multipliers
    before, last = work.last_stages, work.last_multipliers
    c, c_old = work.method.c[method_index(work.stages)], work.method.c[method_index(before)]
    for i in range(work.stages):
        zero(stages[i])
        for r in range(2):
            zero(now[i, r])
        if work.has_last_step == 0 or not prolong or keeps:
            copy(now[i, 1], last[before - 1, 1])
        if work.has_last_step == 0 and prolong and keeps:
            for k in range(stages.shape[1]):
                stages[i, k] = c[i] * h * work.state[SLOPE, k]
        if work.has_last_step == 0 or not prolong:
            continue
        ratio = h / work.accepted_step
        u = 1.0 + c[i] * ratio
        of_mu = ratio**before if before == work.stages else 0.0
        for k in range(now.shape[2]):
            now[i, 0, k] = of_mu * last[i, 0, k]
        for j in range(before):
            v = lagrange(c_old, before, j, u)
            for k in range(0 if keeps else now.shape[2]):
                now[i, 1, k] += v * last[j, 1, k]
            w = v * u / c_old[j]
            if j == before - 1:
                w -= 1.0
            for k in range(stages.shape[1]):
                stages[i, k] += w * old[j, k]


@compiled
def solve_first(h: float, work: RadauState, given: Given) -> None:
    """R[0], G[0] from the residual of one equation with the real matrix to the change."""
    system, _loops, _tangent, matrix = given
    x, along = work.x[0], work.along[0]
    s = work.method.poles[method_index(work.stages), 0] / h
    stage_equations.scale_residual(work.R[0], work.G[0], system, matrix, work.frames[0], x, along)
    stage_equations.couple_length(s, x, along, matrix)
    solve_lu(matrix.nodes, matrix.columns, work.K, work.pivots, x)
    stage_equations.find_length(s, x, along, matrix)
    stage_equations.unscale_solution(x, along, system, matrix, work.frames[0], work.R[0], work.G[0])


@compiled
def separate(inverse: Floats, stages: int, x: Floats, real: Floats, pairs: Any) -> None:
    """T^-1 x for the rows x: its first row, and pairs of the others as complex rows."""
    zero(real)
    for p in range(pair_count(stages)):
        for k in range(real.shape[0]):
            pairs[p, k] = 0.0
    for j in range(stages):
        for k in range(real.shape[0]):
            real[k] += inverse[0, j] * x[j, k]
        for p in range(pair_count(stages)):
            a, b = inverse[1 + 2 * p, j], inverse[2 + 2 * p, j]
            for k in range(real.shape[0]):
                pairs[p, k] += complex(a * x[j, k], b * x[j, k])


@compiled
def unite(T: Floats, stages: int, real: Floats, pairs: Any, x: Floats) -> None:
    """The inverse of ``separate``."""
    for i in range(stages):
        for k in range(real.shape[0]):
            x[i, k] = T[i, 0] * real[k]
        for p in range(pair_count(stages)):
            a, b = T[i, 1 + 2 * p], T[i, 2 + 2 * p]
            for k in range(real.shape[0]):
                x[i, k] += a * pairs[p, k].real + b * pairs[p, k].imag


@compiled
def solve_stages(h: float, work: RadauState, given: Given) -> None:
    """R, G from the residuals of the stages to the changes."""
    system, _loops, _tangent, matrix = given
    x, along, stages, m = work.x, work.along, work.stages, method_index(work.stages)
    poles, T, inverse = work.method.poles[m], work.method.T[m], work.method.T_inverse[m]
    for i in range(stages):
        stage_equations.scale_residual(
            work.R[i], work.G[i], system, matrix, work.frames[i], x[i], along[i]
        )
    separate(inverse, stages, x, work.xr, work.xc)
    separate(inverse, stages, along, work.alongr, work.alongc)
    s = poles[0] / h
    stage_equations.couple_length(s, work.xr, work.alongr, matrix)
    solve_lu(matrix.nodes, matrix.columns, work.K, work.pivots, work.xr)
    stage_equations.find_length(s, work.xr, work.alongr, matrix)
    for p in range(pair_count(stages)):
        sc = pole(poles, p, h)
        stage_equations.couple_length(sc, work.xc[p], work.alongc[p], matrix)
        solve_lu(matrix.nodes, matrix.columns, work.Kc[p], work.pivotsc[p], work.xc[p])
        stage_equations.find_length(sc, work.xc[p], work.alongc[p], matrix)
    unite(T, stages, work.xr, work.xc, x)
    unite(T, stages, work.alongr, work.alongc, along)
    for i in range(stages):
        stage_equations.unscale_solution(
            x[i], along[i], system, matrix, work.frames[i], work.R[i], work.G[i]
        )


@compiled
def subtract_slope(i: int, h: float, inverse: Floats, work: RadauState) -> None:
    """F less the slope of the collocation polynomial at stage i, into R."""
    residual, rates = work.R[i], work.F[i]
    zero(residual)
    for j in range(work.stages):
        a = inverse[i, j] / h
        for k in range(residual.shape[0]):
            residual[k] += a * work.Z[j, k]
    for k in range(residual.shape[0]):
        residual[k] = rates[k] - residual[k]


@compiled
def evaluate_bodies(
    t: float, y: Floats, multipliers: Floats, i: int, out: Floats, work: RadauState, given: Given
) -> None:
    """Rates at a state with multipliers (2, R) into out; G[i] and ``frames[i]`` there."""
    system, loops, _tangent, matrix = given
    stage_equations.evaluate_stage(t, y, multipliers, matrix.held, out, work.G[i], system, loops)
    stage_equations.keep_frames(system.body, work.frames[i])


@compiled_into
def evaluate_stages(t: float, h: float, work: RadauState, given: Given, evaluate: Any) -> None:
    """Residuals of the stages: F - A^-1 Z / h into R, those of the rows into G.

    evaluate: as ``evaluate_bodies``.
    """
    y, argument, m = work.state[Y], work.state[SCRATCH], method_index(work.stages)
    stages, inverse, c = work.Z, work.method.inverse[m], work.method.c[m]
    for i in range(work.stages):
        for k in range(y.shape[0]):
            argument[k] = y[k] + stages[i, k]
        evaluate(t + c[i] * h, argument, work.multipliers[i], i, work.F[i], work, given)
        subtract_slope(i, h, inverse, work)
    work.rhs_count += work.stages


@compiled
def size_of_multipliers(h: float, change: Floats, work: RadauState, system: System) -> float:
    """Norm of multipliers (2, R): as changes of y, h M^-1 D^T times them (HW VII.4: index 2)."""
    y, out = work.state[Y], work.state[SCRATCH]
    moved, n = system.change, system.metric.shape[0] - 1
    zero(out)
    zero(moved)
    stage_equations.add_transposed(system.blocks, system.D, change[0], h, moved)
    add_displacement(y, system.metric, moved, out)
    zero(moved)
    stage_equations.add_transposed(system.blocks, system.D, change[1], h, moved)
    add_velocity(system.metric, moved, out[velocity_offset(1, n) :])
    return convergence.size_of_change(out, h, work)


@compiled
def change_stages(h: float, work: RadauState, system: System) -> float:
    """Add the changes in R and G to the stages; returns their norm.

    Multipliers do not count where rows are regularised: those that depend on others have a part of
    rounding over what regularises them, new in each iteration, that moves nothing.
    """
    y = work.state[Y]
    work.state_change = work.multiplier_change = 0.0
    for i in range(work.stages):
        size = convergence.size_of_change(work.R[i], h, work)
        other = size_of_multipliers(h, work.G[i], work, system)
        if not size <= work.state_change:
            work.state_change = size
        if not other <= work.multiplier_change:
            work.multiplier_change = other
        for k in range(y.shape[0]):
            work.Z[i, k] += work.R[i, k]
        for r in range(2):
            for k in range(work.G.shape[2]):
                work.multipliers[i, r, k] += work.G[i, r, k]
    if work.regularisation != 0.0 or work.multiplier_change <= work.state_change:
        return work.state_change
    return work.multiplier_change


@compiled
def most_iterations(stages: int) -> int:
    """Iterations that the stages of a step are found in, at most."""
    return MOST + MORE * method_index(stages)


@compiled
def find_stages(t: float, h: float, work: RadauState, given: Given) -> float:
    """``iterate_stages`` on the equations of bodies."""
    shorter = iterate_stages(t, h, work, given, evaluate_bodies, solve_stages, change_stages)
    if shorter == 0.0 and is_differentiated():
        find_slopes(t, h, work, given, evaluate_bodies, solve_stages)
    return shorter


@compiled_into
def find_slopes(
    t: float, h: float, work: RadauState, given: Given, evaluate: Any, solve: Any
) -> None:
    """Derivatives of the stages, whose values are found: the iteration goes on for them alone.

    evaluate, solve: as of ``iterate_stages``. It stopped by values, which may be right from the
    start, as of a uniform motion; derivatives follow at the rate of the tangent, which lacks what
    sliding does to the force that it depends on.
    """
    stages, moves, found, changes = work.Z, work.R, work.multipliers, work.G
    before = LARGEST
    for done in range(convergence.MOST_OF_SLOPES):
        evaluate_stages(t, h, work, given, evaluate)
        solve(h, work, given)
        work.rhs_count -= work.stages
        change = convergence.change_of_slopes(work)
        for i in range(work.stages):
            for k in range(stages.shape[1]):
                stages[i, k] = with_slopes(stages[i, k], stages[i, k] + moves[i, k])
            for r in range(2):
                for k in range(found.shape[2]):
                    found[i, r, k] = with_slopes(found[i, r, k], found[i, r, k] + changes[i, r, k])
        if change <= work.newton_limit * work.rtol or (
            done > 0 and not change < convergence.WORTH * before
        ):
            return
        before = change


@compiled_into
def iterate_stages(
    t: float, h: float, work: RadauState, given: Given, evaluate: Any, solve: Any, change_by: Any
) -> float:
    """Newton's iteration for the stages of a step h.

    evaluate, solve, change_by: as ``evaluate_bodies``, ``solve_stages``, ``change_stages``.

    Returns:
        0 where they are found; else the factor on the step that is to be tried; NaN where a number
        is not finite.
    """
    tangent = given[2]
    limit, fixed = work.newton_limit, work.fixed_step != 0.0
    stale = abs(h - work.factored_step) / h  # factors of another step converge at this rate
    work.convergence_factor = max(max(work.convergence_factor, EPSILON) ** 0.8, stale)
    before = ratio = ratio_before = states = multipliers = 1.0
    most = MOST_FIXED if fixed else most_iterations(work.stages)
    least = 2 if tangent.bends[0] == BENT else 1  # rates of other steps say nothing across a bend
    for done in range(1, most + 1):
        evaluate_stages(t, h, work, given, evaluate)
        solve(h, work, given)
        change = change_by(h, work, given[0])
        work.iteration_count, work.last_iterations = work.iteration_count + 1, done
        if not change <= LARGEST:
            return math.nan
        if convergence.is_exact(change, before if done == least > 1 else LARGEST, limit, work):
            return 0.0
        if done > 1:
            ratio = change / before
            theta = ratio if done == 2 else math.sqrt(ratio * ratio_before)
            ratio_before = ratio
            slow = not convergence.converges(theta, change, limit, most - 1 - done)
            if slow and convergence.is_stalled(states, multipliers, limit, work):
                return 0.0
            work.convergence_rate = theta
            patient = fixed or (slow and convergence.is_settling(multipliers, work))
            if theta >= convergence.SLOWEST:
                if convergence.is_at_rounding(change, limit, work):
                    return 0.0
                if done > PATIENCE or not patient:
                    return UNFOUND
                work.convergence_rate = convergence.SLOWEST
            theta = work.convergence_rate
            if least > 1 and max(before, change) <= UNSEEN_CHANGE * limit:
                work.convergence_rate = min(theta, UNSEEN_RATE)
            work.convergence_factor = theta / (1.0 - theta)
            left = work.convergence_factor * change * theta ** (most - 1 - done) / limit
            if done < most and left >= 1.0 and not patient:
                excess = max(1e-4, min(20.0, left))
                return 0.8 * excess ** (-1.0 / (3.0 + most - done))
        before = max(change, EPSILON)
        states, multipliers = work.state_change, work.multiplier_change
        factor = work.convergence_factor
        if done > 1 and (work.has_last_step == 0 or least > 1):  # the first rate may be that of
            last = 0.5 if done == 2 else ratio  # the stiff side of a bend alone
            factor = max(factor, last / (1.0 - last) if last < 1.0 else LARGEST)
        if factor * change <= limit and done >= least and (done > 1 or change <= 1.0):
            return 0.0
    return UNFOUND
