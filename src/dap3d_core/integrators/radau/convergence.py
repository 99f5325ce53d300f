"""Convergence of the iteration of a Radau step: at its limit, or at rounding."""

from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.integrators.stepping.integration_state import ABSOLUTE, MOST, NOISE, Y
from dap3d_core.integrators.stepping.step_control import EPSILON
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import slope, slope_count

#: An iteration that converges slower than this does not.
SLOWEST = 0.99
#: A change of this many roundings is none.
ROUNDINGS = 10.0
#: Where multipliers fall by this much in an iteration the stages are yet to follow them.
SETTLING = 0.1
#: Changes up to this many roundings of a state show no rate of convergence.
RATELESS = 1e3
#: Changes up to this many limits may be rounding where the iteration stagnates, if they are up
#: to this many roundings: near a singular pose a state is known to one over its distance squared.
STALLED, MOST_ROUNDINGS = 10.0, 1e6
#: Passes at most for derivatives of stages, and how much a pass must bring them on to be worth it.
MOST_OF_SLOPES, WORTH = 40, 0.5


@compiled
def size_of_change(change: Floats, h: float, work: RadauState) -> float:
    """Norm of a change of the state, as ``scaled_largest``.

    Where a tolerance asks for more than the rounding of the largest component lets an iteration
    find, that takes its place: a change of ROUNDINGS of it is at the limit. The others are found
    as exactly as they would be without.
    """
    y, rtol, tolerance = work.state[Y], work.rtol, work.tolerance
    counts, rounding = work.counts, ROUNDINGS * EPSILON / work.newton_limit
    first, largest = 0, 0.0
    for group in range(3):
        last, least = min(first + counts[group], work.error_size), 0.0
        if group < 2:  # states of elements have units of their own
            for k in range(first, last):
                least = max(least, rounding * abs(y[k]))
        for k in range(first, last):
            scale = max(tolerance[ABSOLUTE, k] + rtol * abs(y[k]), least)
            noise = min(h * tolerance[NOISE, k], tolerance[MOST, k])
            ratio = (abs(change[k]) - noise) / max(noise, scale)
            if not ratio <= largest:
                largest = ratio
        first = last
    return largest


@compiled
def is_at_rounding(change: float, limit: float, work: RadauState) -> bool:
    """True if a change says nothing of how an iteration converges.

    A larger one does, though it be within the limit: where a law bends within the tolerance, as
    friction below its v_tol may, stages that jump from one side to the other are not found.
    """
    return change <= min(limit, RATELESS * EPSILON / work.rtol)


@compiled
def is_exact(change: float, before: float, limit: float, work: RadauState) -> bool:
    """True if the last changes are rounding alone, which shows no rate of convergence.

    before: the change before; LARGEST where one change of zero counts, and no other.
    """
    if change > 0.0 and not is_at_rounding(max(before, change), limit, work):
        return False
    if change > 0.0:
        work.convergence_rate = 0.0
    return True


@compiled
def converges(theta: float, change: float, limit: float, left: int) -> bool:
    """True if ``left`` more iterations at the rate theta reach the limit."""
    return theta < SLOWEST and theta / (1.0 - theta) * change * theta**left < limit


@compiled
def is_stalled(states: float, multipliers: float, limit: float, work: RadauState) -> bool:
    """True if an iteration that does not converge has reached the rounding of its tangent.

    Multipliers are known to their own last digits: under large forces, and near a singular pose,
    these are more than a tolerance allows a state, but move none. States count as found where their
    last two changes were less than MOST_ROUNDINGS and STALLED times the limit, which still is a
    third of what a step may be off by (implicit.estimate_tolerances).
    """
    least = min(STALLED * limit, MOST_ROUNDINGS * EPSILON / work.rtol)
    return (
        work.tangent_is_current != 0
        and max(states, work.state_change) <= least
        and work.multiplier_change > SETTLING * multipliers
    )


@compiled
def is_settling(multipliers: float, work: RadauState) -> bool:
    """True if multipliers that have no part in the norm still converge, as they do before states.

    Behind a singular pose they change by much where the motion hardly does.
    """
    return work.regularisation != 0.0 and work.multiplier_change < SETTLING * multipliers


@compiled
def change_of_slopes(work: RadauState) -> float:
    """The last change of the derivatives of the stages, as a part of the largest of their group."""
    y, worst = work.state[Y], 0.0
    for d in range(slope_count()):
        first = 0
        for group in range(3):
            last = min(first + work.counts[group], work.error_size)
            size = change = 0.0
            for k in range(first, last):
                size = max(size, abs(slope(y[k], d)))
                for i in range(work.stages):
                    size = max(size, abs(slope(work.Z[i, k], d)))
                    change = max(change, abs(slope(work.R[i, k], d)))
            if not change <= worst * size:
                worst = change / size
            first = last
    return worst
