"""Projection of a state onto constraint rows: Newton's iteration, by the least change in a metric.

What the rows are, in which coordinates, is a module of functions (constraints.py here, and
joint_loops/kept_rows.py):

    normalise               Euler parameters of a state to unit length
    place                   bodies of the state, and functions of time
    residuals               C of the rows; returns the largest, m
    linearise               the rows at the bodies as placed
    factorise_anyway        what solves for the least change, where the pose is singular, too
    displace                a state by the least change that removes C; places bodies
    velocity_residuals      D v - nu of the rows; returns the largest, m/s
    change_velocities       by the least change that removes these; returns the largest that is left
    size_of_positions, size_of_velocities    of which tolerances are a part
    is_poor                 whether the pose is close to a singular one, and lengths that say so
"""

from typing import Any

from dap3d_core.assembly.arrays import TOLERANCE_C, TOLERANCE_V, Floats, System
from dap3d_core.kernels.runtime.cache import compiled_into

#: Newton passes of one projection; the second already reaches rounding.
PASSES = 5
#: Where a pass with the factors of another pose leaves more than this part of the residual, the
#: next has new ones: with very different masses a small turn changes which body gives way.
REFACTOR_RATIO = 0.1
#: A residual that stays above this many times the tolerance means that the projection did not find
#: the constraints: with independent rows, and where redundant ones may misfit (by FIT of
#: simulation/initial/assemble.py).
PROJECTION_FAILURE_FACTOR, REDUNDANT_FAILURE_FACTOR = 1e6, 1e8


@compiled_into
def project_onto(
    t: float,
    y: Floats,
    out: Floats,
    system: System,
    loops: Any,
    rows: Any,
    part: float | None,
    is_redundant: bool,
    kept: bool,
) -> None:
    """Move a state onto constraint rows.

    With regularised factors the passes are those of the proximal method as well: each leaves a
    ``part`` of what the one before has left. Of rows that depend on each other (``is_redundant``)
    factors of another pose have the wrong null space.

    out: on entry 1.0 where rhs was evaluated last at this very t and y: the linearised rows are
    valid, and the factors, too, if rhs leaves those of ``part`` (``kept``). Then: 1.0 if y changed
    beyond rounding; 1.0 if it did not converge, 2.0 if the pose is close to a singular one; largest
    residuals of position and velocity; lengths that go linearly through zero at a singular pose.
    """
    linear = out[0] == 1.0
    factored = linear and kept
    stale = False
    lost = REDUNDANT_FAILURE_FACTOR if is_redundant else PROJECTION_FAILURE_FACTOR
    out[0] = out[1] = 0.0
    rows.normalise(y, system)
    if not linear:
        rows.place(t, y, system, loops)
    worst = rows.residuals(t, system, loops)
    limit = system.settings[TOLERANCE_C] * rows.size_of_positions(y, system)
    if not worst <= limit:
        if not linear:
            rows.linearise(t, system, loops)
        if not factored:
            rows.factorise_anyway(system, part)
        for _ in range(PASSES):
            before = worst
            rows.displace(y, system)
            worst = rows.residuals(t, system, loops)
            if not worst > limit or not worst < 0.5 * before:
                break
        linear, factored = False, not is_redundant
        stale = factored
        out[0] = 1.0
        if not worst <= lost * limit:
            out[1] = 1.0
    out[2] = worst
    if not linear:
        rows.linearise(t, system, loops)
    if not factored:
        rows.factorise_anyway(system, part)
    project_velocities(y, out, system, rows, part, lost, stale)
    if rows.is_poor(t, system, loops, part, out[4:]) and out[1] == 0.0:
        out[1] = 2.0


@compiled_into
def project_velocities(
    y: Floats,
    out: Floats,
    system: System,
    rows: Any,
    part: float | None,
    lost: float,
    stale: bool,
) -> None:
    """The velocities' part of ``project_onto``, with the rows of this pose.

    lost: times the tolerance, what says that it did not converge. stale: the factors are those of
    the pose before positions moved.
    """
    worst = rows.velocity_residuals(system)
    limit = system.settings[TOLERANCE_V] * rows.size_of_velocities(y, system)
    if not worst <= limit:
        for _ in range(PASSES):
            before = worst
            worst = rows.change_velocities(y, system)
            if not worst > limit or not (stale or worst < 0.5 * before):
                break
            if stale and not worst < REFACTOR_RATIO * before:
                rows.factorise_anyway(system, part)
                stale = False
        out[0] = 1.0
        if not worst <= lost * limit:
            out[1] = 1.0
    out[3] = worst
