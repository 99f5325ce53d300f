"""An integration by Radau IIA in joint coordinates: y' = f(t, y), without rows.

What joints hold is out of the coordinates, and rows that are kept on a tree are eliminated in f, as
in any integration by method joint. The tangent is that of the whole right-hand side, one column for
each component, by differences: its differentiated form, in lanes, would be code that neither plain
Python nor an exported model has. It only has to let the iteration converge. Modes of contacts and
what goes with them are constant, and have no columns where they are the last states.
"""

import math
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import LENGTH, STEP, Floats, System
from dap3d_core.assembly.evaluate import copy
from dap3d_core.formulations.stabilized_index2.jacobian import BENT, MAY_BEND
from dap3d_core.integrators.radau import newton
from dap3d_core.integrators.radau.convergence import size_of_change
from dap3d_core.integrators.radau.error import filter_error, measure_noise, sum_work
from dap3d_core.integrators.radau.integration import RadauIntegration
from dap3d_core.integrators.radau.state import TRIAL_SLOPE, Given, RadauState
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import OTHER, SCRATCH, TRIAL, Y
from dap3d_core.kernels.compiler.types import Table
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import is_differentiated
from dap3d_core.linear.lu import StateNode, make_lu_plan, solve_lu

#: Step of a difference, as part of a component's size: short against the depth of stiff contact
#: and against v_tol of friction, whose bends it must not reach over.
PART = 1e-12
#: Lengths of differences over bends, and their ratio; slopes that count as steeper.
LEVELS, COARSER, STEEPER = 6, 16.0, 2.0
#: A difference of more than this part of the largest rate may be a jump: it is one where the
#: quotient over a step that is COARSER is smaller by more than the factor JUMPS.
JUMP, JUMPS = 1e-7, 4.0
#: Least size of a rate, as part of the scene's length (or of a radian) a second.
LEAST_RATE = 1e-2


@attrs.frozen(eq=False, kw_only=True, slots=False)
class RateTangent(Arrays):
    """df/dy, and the elimination program of a dense matrix."""

    nodes: IntegerMatrix  # of linear.lu.LuPlan, as the next two
    columns: IntegerMatrix
    updates: IntegerMatrix
    bends: Floats  # (1,) as of ``Tangent``
    J: Matrix  # (N, N) of the components that change, without the work


@compiled
def find_rate_tangent(work: RadauState, given: Given) -> None:
    """The tangent at the predicted end of the step, as ``find_tangent``.

    Once an iteration failed, of differences over steps of many lengths the steepest are taken:
    those over the bend of a law that is flat where the motion is, as in jacobian.py. What jumps, as
    the damping of a cable does where it becomes taut and a motion starts anew, has no slope: that
    on its other side is taken.
    """
    system, loops, tangent, functions = given
    rhs, y, J, bends = functions[0], work.state[SCRATCH], tangent.J, tangent.bends
    f, changed, length = work.state[TRIAL], work.state[OTHER], system.settings[LENGTH]
    at = work.t + work.tangent_step if work.has_last_step != 0 else work.t
    for k in range(y.shape[0]):
        y[k] = work.state[Y, k] + work.Z[work.stages - 1, k]
    rhs(at, y, f, system, loops)
    trials = 2 * LEVELS if bends[0] >= MAY_BEND else 1
    n, jump = J.shape[0], 0.0
    for i in range(n):
        jump = max(jump, JUMP * abs(f[i]))
    finite = abs(f[f.shape[0] - 1]) < math.inf
    work.rhs_count += 1
    for j in range(n):
        now, is_rate = y[j], j >= work.counts[0]
        least = 0.0 if j >= work.counts[0] + work.counts[1] else length
        step = PART * max(abs(now), LEAST_RATE * least if is_rate else least)
        step, steepest, first, trial = step if step > 0.0 else PART, -1.0, 0.0, 0
        for i in range(n):
            J[i, j] = 0.0
        while trial < trials or (steepest < 0.0 and trial < 2 * LEVELS):
            h = step if trial % 2 == 0 else -step
            slope = slopes(at, j, h, y, f, changed, work, system, loops, functions)
            if jump < slope * step < math.inf:
                far = slopes(at, j, COARSER * h, y, f, changed, work, system, loops, functions)
                slope = slopes(at, j, h, y, f, changed, work, system, loops, functions)
                slope = -1.0 if slope > JUMPS * far else slope
            finite = finite and abs(changed[f.shape[0] - 1]) < math.inf  # no power: forces jam
            first = slope if steepest < 0.0 else first
            if (slope >= 0.0 and slope > STEEPER * steepest) or not slope < math.inf:
                steepest = slope
                for i in range(n):
                    J[i, j] = changed[i]
            step *= COARSER if trial % 2 == 1 else 1.0
            trial += 1
        if steepest > STEEPER * first:
            bends[0] = BENT
        finite = finite and steepest < math.inf
    work.jacobian_count += 1
    work.tangent_needed, work.tangent_is_current = 0, 1 if finite else 0
    work.factored_step = 0.0


@compiled
def slopes(
    t: float, j: int, step: float, y: Floats, f: Floats, out: Floats, work: RadauState,
    system: System, loops: Any, functions: Any,
) -> float:  # fmt: skip
    """Difference quotients of the rates f at y by component j into out; returns the largest."""
    rhs, now, largest = functions[0], y[j], 0.0
    y[j] = now + step
    step = y[j] - now
    rhs(t, y, out, system, loops)
    work.rhs_count += 1
    for i in range(y.shape[0] - 1):
        out[i] = (out[i] - f[i]) / step
        largest = max(largest, abs(out[i]))
    y[j] = now
    return largest


@compiled
def fill_dense(s: Any, K: Any, given: Given) -> None:
    """K = s - J, for real or complex s in 1/s."""
    J, n = given[2].J, given[2].J.shape[0]
    for i in range(n):
        for j in range(n):
            K[n * i + j] = -J[i, j]
        K[(n + 1) * i] += s


@compiled
def factorise_rates(t: float, h: float, work: RadauState, given: Given) -> float:
    """As ``factorise_both``."""
    return newton.factorise(h, work, given, given[2], fill_dense)


@compiled
def evaluate_rate(
    t: float, y: Floats, multipliers: Floats, i: int, out: Floats, work: RadauState, given: Given
) -> None:
    """As ``evaluate_bodies``; there are no multipliers."""
    system, loops, _tangent, functions = given
    rhs = functions[0]
    rhs(t, y, out, system, loops)


@compiled
def solve_rates(h: float, work: RadauState, given: Given) -> None:
    """R from the residuals of the stages to the changes; that of the work is none."""
    tangent = given[2]
    stages, m = work.stages, newton.method_index(work.stages)
    newton.separate(work.method.T_inverse[m], stages, work.R, work.xr, work.xc)
    solve_lu(tangent.nodes, tangent.columns, work.K, work.pivots, work.xr)
    for p in range(newton.pair_count(stages)):
        solve_lu(tangent.nodes, tangent.columns, work.Kc[p], work.pivotsc[p], work.xc[p])
    newton.unite(work.method.T[m], stages, work.xr, work.xc, work.R)
    for i in range(stages):
        work.R[i, work.R.shape[1] - 1] = 0.0


@compiled
def change_rates(h: float, work: RadauState, system: System) -> float:
    """Add the changes in R to the stages; returns their norm."""
    work.state_change = work.multiplier_change = 0.0
    for i in range(work.stages):
        size = size_of_change(work.R[i], h, work)
        if not size <= work.state_change:
            work.state_change = size
        for k in range(work.Z.shape[1]):
            work.Z[i, k] += work.R[i, k]
    return work.state_change


@compiled
def find_rate_stages(t: float, h: float, work: RadauState, given: Given) -> float:
    """As ``find_stages``."""
    shorter = newton.iterate_stages(t, h, work, given, evaluate_rate, solve_rates, change_rates)
    if shorter == 0.0 and is_differentiated():
        newton.find_slopes(t, h, work, given, evaluate_rate, solve_rates)
    return shorter


@compiled
def solve_rate(h: float, work: RadauState, given: Given) -> None:
    """R[0] from a residual to the change, with the real matrix."""
    tangent = given[2]
    x, residual = work.xr, work.R[0]
    copy(x, residual)
    solve_lu(tangent.nodes, tangent.columns, work.K, work.pivots, x)
    copy(residual[: x.size], x)
    residual[residual.shape[0] - 1] = 0.0


@compiled
def estimate_rate_error(t: float, h: float, work: RadauState, given: Given) -> float:
    """As ``estimate_error``."""
    return filter_error(t, h, work, given, evaluate_rate, solve_rate)


@compiled
def find_rate_slope(t: float, h: float, work: RadauState, given: Given) -> float:
    """dy/dt at the trial state, into TRIAL_SLOPE."""
    system, loops, _tangent, functions = given
    rhs = functions[0]
    work.rhs_count += 1
    rhs(t + h, work.state[TRIAL], work.state[TRIAL_SLOPE], system, loops)
    return 0.0


@compiled
def measure_rate_noise(t: float, h: float, work: RadauState, given: Given) -> float:
    """As ``measure_stage_noise``."""
    return measure_noise(t, h, work, given, evaluate_rate, solve_rate)


@compiled
def find_rate_work(t: float, h: float, work: RadauState, given: Given) -> float:
    """As ``find_work``."""
    newton.evaluate_stages(t, h, work, given, evaluate_rate)
    sum_work(h, work)
    return 0.0


class JointRadauIntegration(RadauIntegration):
    """As ``RadauIntegration``, of an evaluator by method joint.

    Its matrix is dense: factors take the third power of the number of coordinates.
    """

    tangent_kinds = (RateTangent.type_of(), Table(STEP))
    parts = (
        find_rate_tangent, factorise_rates, find_rate_stages, estimate_rate_error, find_rate_slope,
        measure_rate_noise, find_rate_work,
    )  # fmt: skip

    @property
    def _accepts_redundant(self) -> bool:
        return False  # there are no rows

    def make_tangent(self) -> tuple[int, int, tuple[int, int, int]]:
        """As of ``RadauIntegration``."""
        coordinates: Any = self.evaluator.coordinates
        layout, size = coordinates.nodes.layout, coordinates.size
        rates, states = layout["angle_rates"].start, layout["states"].start
        count = states + self._changing_states(size - states)
        self.lu_plan = make_lu_plan(0, (), (), [StateNode(count, ())])
        lu = self.lu_plan
        self.tangent = RateTangent(
            nodes=lu.nodes, columns=lu.columns, updates=lu.updates, bends=np.zeros(1),
            J=np.zeros((count, count)),
        )  # fmt: skip
        return 0, 1, (rates, states - rates, size - states)

    def _changing_states(self, count: int) -> int:
        """Of the states of elements, ``count`` of them, how many come before contacts alone do."""
        contacts = self.evaluator.system.contacts
        if not len(contacts):
            return count
        from dap3d_core.formulations.contacts.equations import OF_CONTACT, STATE

        of_contacts = np.add.outer(contacts[:, STATE], np.arange(OF_CONTACT))
        return int(np.max(np.setdiff1d(np.arange(count), of_contacts), initial=-1)) + 1

    @property
    def loop_arguments(self) -> tuple[Any, ...]:
        """As ``Integration.loop_arguments``."""
        evaluator = self.evaluator
        return (self.work, evaluator.functions, *self._parts, evaluator.system, evaluator.loops,
                self.tangent, evaluator.functions)  # fmt: skip

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``."""
        return Integration.state_arrays(self)

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Integration.all_arrays``."""
        yield from Integration.all_arrays(self)
        yield from self.tangent.walk("tangent.")
