"""Coulomb friction in joints: forces that depend on the multipliers they change (spec 6.1).

The multipliers are found by a fixed-point iteration, from those without friction: equal states give
equal accelerations, whatever came before. Each pass is accelerated by one secant step
(Irons and Tuck, Int. J. Numer. Meth. Engng 1 (1969) 275).
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from collections.abc import Callable
from typing import Any

from dap3d_core.assembly.arrays import FRICTION, UNSETTLED, System
from dap3d_core.assembly.evaluate import call_kinds, zero
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: The multipliers have settled where a pass changes them by less than this part of the largest.
SETTLED = 1e-10
#: Passes at most; the last one is then used, and counted as not settled.
PASSES = 25


@compiled
def has_friction(system: System) -> bool:
    """True if joints of the scene have friction."""
    return bool(system.kinds[FRICTION + 1] > system.kinds[FRICTION])


@compiled
def store_applied_forces(system: System) -> None:
    """Remember the scaled applied forces before they become accelerations."""
    for k in range(system.acceleration.shape[0]):
        system.friction[k] = system.acceleration[k]


@compiled
def apply_friction(t: float, system: System, loops: Any) -> float:
    """Friction for ``multipliers``, added to the scaled applied forces; returns its power."""
    body, metric, forces = system.body, system.metric, system.acceleration
    size = forces.shape[0]
    applied, friction = system.friction[:size], system.friction[size : 2 * size]
    zero(friction)
    call_kinds(
        FRICTION, FRICTION, t, system, loops, friction, system.multipliers, system.multipliers
    )
    power = 0.0
    for b in range(1, body.shape[0]):
        s, k, o = body[b], metric[b], 6 * b
        for c in range(6):
            power += friction[o + c] * s[12 + c]
        n0, n1, n2 = friction[o + 3], friction[o + 4], friction[o + 5]
        for c in range(3):
            forces[o + c] = applied[o + c] + k[0] * friction[o + c]
            turned = k[7 + c] * n0 + k[10 + c] * n1 + k[13 + c] * n2
            forces[o + 3 + c] = applied[o + 3 + c] + turned
    return power


@compiled
def accelerate_fixed_point(system: System, passes: int) -> bool:
    """True if ``multipliers`` have settled; else they become the start of the next pass."""
    x, rows = system.multipliers, system.multipliers.shape[0]
    memory = system.friction[2 * system.force.shape[0] :]
    guess, result, change = memory[:rows], memory[rows : 2 * rows], memory[2 * rows :]
    if passes == 0:
        for k in range(x.shape[0]):
            guess[k] = x[k]
        return False
    size = largest_change = upper = lower = 0.0
    for k in range(x.shape[0]):
        now = x[k] - guess[k]
        size = max(size, abs(x[k]))
        largest_change = max(largest_change, abs(now))
        if passes > 1:
            upper += now * (now - change[k])
            lower += (now - change[k]) * (now - change[k])
    if not largest_change > SETTLED * size:
        return True
    share = upper / lower if lower > 0.0 else 0.0
    if passes == PASSES:
        system.settings[UNSETTLED] += 1.0
        return True
    for k in range(x.shape[0]):
        now = x[k] - guess[k]
        mixed = x[k] - share * (x[k] - result[k]) if passes > 1 else x[k]
        result[k], change[k], guess[k] = x[k], now, mixed
        x[k] = mixed
    return False


@compiled_into
def solve_with_friction(
    t: float, system: System, loops: Any, solve: Callable[[System], None]
) -> float:
    """``solve`` of a formulation, again until friction and multipliers agree; power of friction.

    solve: ``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``.
    """
    power, passes = 0.0, 0
    if has_friction(system):
        store_applied_forces(system)
    solve(system)
    if has_friction(system):
        while not accelerate_fixed_point(system, passes):
            passes += 1
            power = apply_friction(t, system, loops)
            solve(system)
    return power
