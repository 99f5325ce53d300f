"""Common parts of formulations with joints: rows, factors, residuals, reports.

Each formulation compiles what it uses of them. ``part`` says which matrix is factored: None for
[I D^^T; D^ 0], which needs independent rows, a number for [I D^^T; D^ -E] with e_i = part |D^_i|^2.
As None it is known when the code is compiled, so that ``standard`` has no line of the other.
"""

from collections.abc import Callable
from typing import Any

from dap3d_core.assembly.arrays import (
    ACCELERATION,
    EVEN,
    FIRST_STATE,
    LENGTH,
    POSITION,
    SHARE,
    Floats,
    System,
)
from dap3d_core.assembly.evaluate import (  # noqa: F401  read by projection.py
    call_kinds,
    evaluate_forces,
    largest_weighted,
    place,
    place_bodies,
    report_energy,
    scale_velocities,
    zero,
)
from dap3d_core.assembly.state_update import (  # noqa: F401  read by projection.py
    apply_displacement,
    apply_velocity_change,
    normalise,
    size_of_positions,
    size_of_velocities,
)
from dap3d_core.assembly.turns import report_turns
from dap3d_core.formulations.common.friction import solve_with_friction
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.linear.ldlt.factor import (
    add_product,
    assemble,
    factor,
    have_pivots,
    pivot_lengths,
    regularise,
    scale_blocks,
    solve_saddle,
    weigh_rows,
)

#: e_i of regularised factors as part of the squared length of row i: far above rounding, and small
#: enough that two passes leave nothing of a row that is a tenth independent of the others.
PART = 1e-9


@compiled_into
def linearise(t: float, system: System, loops: Any) -> None:
    """D^, gamma and nu of all joints at the bodies as placed."""
    D = system.D
    call_kinds(ACCELERATION, ACCELERATION, t, system, loops, D, system.gamma, system.nu)
    scale_blocks(system.blocks, D, system.metric)


@compiled_into
def linearise_evenly(t: float, system: System, loops: Any) -> None:
    """As ``linearise``, but as if all masses were one, and all inertias, in units of the scene.

    A pose is singular whatever the masses; but a pivot falls as well where a joint turns away from
    a light body that gave way to it, and only a heavy one is left.
    """
    D, blocks, length = system.D, system.blocks, system.settings[LENGTH]
    call_kinds(ACCELERATION, ACCELERATION, t, system, loops, D, system.gamma, system.nu)
    for q in range(blocks.shape[0]):
        for r in range(blocks[q, 2]):
            for c in range(3):
                D[blocks[q, 0] + 6 * r + c] *= length


@compiled_into
def factorise(system: System, part: float | None) -> int:
    """Factors of the current D^, in K.

    Returns the number of pivots that have become small (``system.smallest``): the pose is near a
    singular one.
    """
    if part is not None:
        weigh_rows(system.blocks, system.D, part, system.compliance)
        return factorise_regularised(system)
    assemble(system.targets, system.contributions, system.D, system.K)
    return factor(system.nodes, system.columns, system.updates, system.K, system.smallest, False)


@compiled_into
def factorise_regularised(system: System) -> int:
    """As ``factorise``, with the ``compliance`` of the rows."""
    assemble(system.targets, system.contributions, system.D, system.K)
    regularise(system.nodes, system.compliance, system.K)
    return factor(system.nodes, system.columns, system.updates, system.K, system.smallest, False)


@compiled_into
def slide_sharing(system: System) -> bool:
    """True if contacts that share what they carry slide: the motion depends on the share."""
    contacts, states, found = system.contacts, system.states, False
    for c in range(contacts.shape[0]):
        first = contacts[c, FIRST_STATE]
        slides = (states[first] > 0.5) & (states[first] < 1.5)
        for k in range(first + SHARE, first + SHARE + 3):
            found |= slides & (states[k] != 0.0)
    return found


@compiled_into
def factorise_anyway(system: System, part: float | None) -> None:
    """The same where the pose may be singular to the last digit: regularised there."""
    if factorise(system, part) > 0 and part is None and not have_pivots(system.nodes, system.K):
        factorise(system, PART)


@compiled_into
def solve_rows(system: System, bodies: Floats) -> None:
    """Scaled forces in ``bodies`` become accelerations, gamma in ``multipliers`` -lambda."""
    solve_saddle(system.blocks, system.hubs, system.nodes, system.columns, system.D, system.K,
                 system.multipliers, bodies)  # fmt: skip


@compiled_into
def power_of_drivers(system: System) -> float:
    """Power of the reactions, with -lambda in ``multipliers``: only moving constraints do work."""
    power = 0.0
    for k in range(system.nu.shape[0]):
        power -= system.multipliers[k] * system.nu[k]
    return power


@compiled_into
def solve_equations(
    t: float,
    y: Floats,
    system: System,
    loops: Any,
    part: float | None,
    solve: Callable[[System], None],
) -> float:
    """Scaled ``acceleration`` and ``multipliers``; returns the power of forces and drivers.

    solve: of a formulation, from the scaled forces in ``acceleration``, with factors of ``part``.
    """
    power = evaluate_forces(t, y, system, loops)
    linearise(t, system, loops)
    factorise(system, part)
    power += solve_with_friction(t, system, loops, solve)
    return power + power_of_drivers(system)


@compiled
def residuals(t: float, system: System, loops: Any) -> float:
    """C, zero where a row has no position level, into ``residual``; returns the largest, m."""
    C = system.residual
    zero(C)
    call_kinds(POSITION, POSITION, t, system, loops, C, C, C)
    return largest_weighted(C, system.weight)


@compiled
def velocity_residuals(system: System) -> float:
    """D v - nu into ``residual``, with the current D^; returns the largest, m/s."""
    scale_velocities(system.body, system.metric, system.velocity)
    return residual_of(system, system.velocity, system.nu)


@compiled
def acceleration_residual(system: System) -> float:
    """D a - gamma into ``residual``; returns the largest, m/s^2."""
    return residual_of(system, system.acceleration, system.gamma)


@compiled_into
def residual_of(system: System, x: Floats, right: Floats) -> float:
    """D x less its right-hand side into ``residual``; returns the largest."""
    residual = system.residual
    for k in range(residual.shape[0]):
        residual[k] = -right[k]
    add_product(system.blocks, system.D, x, residual)
    return largest_weighted(residual, system.weight)


@compiled
def correct(system: System) -> None:
    """The least scaled ``change`` of the bodies that removes ``residual``."""
    multipliers, residual = system.multipliers, system.residual
    zero(system.change)
    for k in range(residual.shape[0]):
        multipliers[k] = -residual[k]
    solve_rows(system, system.change)


@compiled_into
def displace(y: Floats, system: System) -> None:
    """Move bodies by the least change that removes C, ``residual``."""
    correct(system)
    apply_displacement(y, system)
    place_bodies(y, system.body, system.metric)


@compiled_into
def change_velocities(y: Floats, system: System) -> float:
    """Change velocities by the least that removes D v - nu; the largest that is left."""
    correct(system)
    apply_velocity_change(y, system.metric, system.change)
    add_product(system.blocks, system.D, system.change, system.residual)
    return largest_weighted(system.residual, system.weight)


@compiled_into
def is_poor(t: float, system: System, loops: Any, part: float | None, lengths: Floats) -> bool:
    """True if the pose is close to a singular one; D^ and its factors may have changed."""
    if system.settings[EVEN] != 0.0:
        linearise_evenly(t, system, loops)
        factorise(system, part)
    return pivot_lengths(system.nodes, system.K, system.smallest, lengths) > 0


@compiled
def report_levels(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Angles, energy and residuals into the end of out.

    The last four are the potential energy and the largest residuals of position, velocity and
    acceleration; before them are the angles whose turns are counted, those of joints last.
    """
    last = out.shape[0] - 4
    out[last + 3] = acceleration_residual(system)
    out[last + 2] = velocity_residuals(system)
    out[last + 1] = residuals(t, system, loops)
    report_energy(t, out, system, loops)
    report_turns(t, y, out[last - system.turns.shape[0] :], system)


@compiled
def report_multipliers(system: System, out: Floats) -> None:
    """Multipliers in the order of the model, after the accelerations."""
    first = 6 * (system.body.shape[0] - 1)
    for k in range(system.row.shape[0]):
        out[first + k] = -system.multipliers[system.row[k]]
