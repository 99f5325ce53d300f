"""Standard formulation: accelerations and multipliers from the saddle-point equations.

Manual: analysis_s; spec 9.

    [M  D^T] (v_dot  )   (g    )
    [D   0 ] (-lambda) = (gamma)

solved by the block LDL^T of linear/blocks.py. Needs independent rows.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.evaluate import (
    call_loops,
    global_accelerations,
    largest,
    place_bodies,
    rates,
    scale_forces,
    scale_velocities,
    zero,
)
from dap3d_core.assembly.system import (
    ACCELERATION,
    ENERGY,
    POSITION,
    VALUE,
    WRENCH,
    Floats,
    System,
)
from dap3d_core.formulations.moves import change_velocity, move, normalise, size_of
from dap3d_core.kernels.cache import compiled, compiled_inside
from dap3d_core.linear.blocks import (
    add_product,
    assemble,
    factor,
    scale_blocks,
    solve_saddle,
)

#: Newton passes of one projection; the second already stands at rounding.
PASSES = 5

#: A residual that stays above this many times the tolerance means that the projection did not find
#: the constraints.
LOST = 1e6


@compiled
def linearise(t: float, system: System, loops: Any, refactor: bool) -> int:
    """D^, gamma and nu of all joints at the bodies as placed; if ``refactor``, factors in K, too.

    Returns the number of pivots that have become small (``system.smallest``): the pose is near a
    singular one.
    """
    kinds, D = system.kinds, system.D
    call_loops(kinds[ACCELERATION], kinds[ACCELERATION + 1], t, system.body, system.F, system.idx,
               system.par, system.groups, loops, D, system.gamma, system.nu)  # fmt: skip
    scale_blocks(system.blocks, D, system.metric)
    if not refactor:
        return 0
    assemble(system.targets, system.contributions, D, system.K)
    return factor(system.nodes, system.columns, system.updates, system.K, system.smallest, False)


@compiled_inside
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled accelerations into ``force``, -lambda into ``x``; power of forces and drivers."""
    body, metric, force, kinds = system.body, system.metric, system.force, system.kinds
    x = system.x
    place_bodies(y, body, metric)
    zero(force)
    call_loops(kinds[VALUE], kinds[WRENCH + 1], t, body, system.F, system.idx,
               system.par, system.groups, loops, force, force, force)  # fmt: skip
    power = scale_forces(body, metric, force)
    linearise(t, system, loops, True)
    for k in range(x.shape[0]):
        x[k] = system.gamma[k]
    solve_saddle(
        system.blocks, system.hubs, system.nodes, system.columns, system.D, system.K, x, force
    )
    for k in range(x.shape[0]):
        power -= x[k] * system.nu[k]
    return power


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    power = accelerate(t, y, system, loops)
    rates(y, system.metric, system.force, out)
    out[out.shape[0] - 1] = power


@compiled_inside
def residuals(t: float, system: System, loops: Any) -> float:
    """Position-level residuals (zero where a row has none) into C; returns the largest size."""
    kinds, C = system.kinds, system.C
    zero(C)
    call_loops(kinds[POSITION], kinds[POSITION + 1], t, system.body, system.F, system.idx,
               system.par, system.groups, loops, C, C, C)  # fmt: skip
    return largest(C)


@compiled_inside
def velocity_residuals(system: System) -> float:
    """D v - nu into C, with D^ as it stands; returns the largest magnitude."""
    C = system.C
    scale_velocities(system.body, system.metric, system.force)
    for k in range(C.shape[0]):
        C[k] = -system.nu[k]
    add_product(system.blocks, system.D, system.force, C)
    return largest(C)


@compiled
def correct(system: System) -> None:
    """The least scaled change of the bodies that removes the residuals in C, into ``force``."""
    x, C, force = system.x, system.C, system.force
    zero(force)
    for k in range(x.shape[0]):
        x[k] = -C[k]
    solve_saddle(
        system.blocks, system.hubs, system.nodes, system.columns, system.D, system.K, x, force
    )


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto its constraints, by the least change in the metric of the masses.

    out: 1.0 if y changed beyond rounding; 1.0 if it did not converge, 2.0 if the pose is close to a
    singular one; largest residuals of position and velocity.
    """
    body, metric, force, kinds = system.body, system.metric, system.force, system.kinds
    n = body.shape[0] - 1
    out[0] = out[1] = 0.0
    normalise(y, n)
    place_bodies(y, body, metric)
    call_loops(kinds[VALUE], kinds[VALUE + 1], t, body, system.F, system.idx,
               system.par, system.groups, loops, force, force, force)  # fmt: skip
    worst = residuals(t, system, loops)
    limit = system.settings[0] * size_of(y, 0, n, 7, 3)
    refactor, poor = True, False
    if not worst <= limit:
        poor = linearise(t, system, loops, True) > 0
        refactor = False
        for _ in range(PASSES):
            before = worst
            correct(system)
            move(y, metric, force)
            place_bodies(y, body, metric)
            worst = residuals(t, system, loops)
            if not worst > limit or not worst < 0.5 * before:
                break
        out[0] = 1.0
        if not worst <= LOST * limit:
            out[1] = 1.0
    out[2] = worst
    poor = linearise(t, system, loops, refactor) > 0 or poor
    worst = velocity_residuals(system)
    limit = system.settings[1] * size_of(y, 7 * n, n, 6, 6)
    if not worst <= limit:
        for _ in range(PASSES):
            before = worst
            correct(system)
            change_velocity(y, metric, force)
            add_product(system.blocks, system.D, force, system.C)
            worst = largest(system.C)
            if not worst > limit or not worst < 0.5 * before:
                break
        out[0] = 1.0
        if not worst <= LOST * limit:
            out[1] = 1.0
    out[3] = worst
    if poor and out[1] == 0.0:
        out[1] = 2.0


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals.

    That is the potential energy and the largest residuals of position, velocity and acceleration.
    """
    kinds, value, C = system.kinds, system.settings[2:3], system.C
    accelerations = 6 * (system.body.shape[0] - 1)
    count = system.row.shape[0]
    last = accelerations + count
    accelerate(t, y, system, loops)
    global_accelerations(system.metric, system.force, out)
    for k in range(count):
        out[accelerations + k] = -system.x[system.row[k]]
    for k in range(C.shape[0]):
        C[k] = -system.gamma[k]
    add_product(system.blocks, system.D, system.force, C)
    out[last + 3] = largest(C)
    out[last + 2] = velocity_residuals(system)
    out[last + 1] = residuals(t, system, loops)
    value[0] = 0.0
    call_loops(kinds[ENERGY], kinds[ENERGY + 1], t, system.body, system.F, system.idx,
               system.par, system.groups, loops, value, value, value)  # fmt: skip
    out[last] = value[0]
