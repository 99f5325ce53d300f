"""Forces that depend on the multipliers they change: friction in joints, forces on reactions.

The multipliers are found by a fixed-point iteration, from those without these forces: equal states
give equal accelerations, whatever came before. Each pass is extrapolated from the difference of the
two before (Irons and Tuck, Int. J. Numer. Meth. Engng 1 (1969) 275); of forces on reactions from
those of more passes (Anderson, J. ACM 12 (1965) 547): brakes that load themselves, each by a part
of its own, settle in as many passes as there are.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import FRICTION, JAMS, UNSETTLED, Floats, System
from dap3d_core.assembly.evaluate import add_force, call_kinds, copy, zero
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where

#: The multipliers have settled where a pass changes them by less than this part of the largest.
SETTLED = 1e-10
#: Passes at most; the last one is then used, and counted as not settled.
PASSES = 25
#: Differences of passes that are kept of forces on reactions; then they begin anew.
DEPTH = 8
#: Of a difference made orthogonal to the earlier ones, less than this part (squared) is rounding.
DIFFERENCE_ROUNDING = 1e-12


def forces_by(t: float, system: System, loops: Any, Lam: Floats) -> Floats:
    """(6 (n + 1),) the forces that depend on multipliers, for some (rows,), at the current poses.

    Force and moment about the mass centre of each body, ground first, global axes.
    """
    force, minus = np.zeros_like(system.force), np.zeros_like(system.multipliers)
    minus[system.row] = -Lam
    call_kinds(FRICTION, FRICTION, t, system, loops, force, minus, minus)
    return force


@compiled
def has_friction(system: System) -> bool:
    """True if forces of the scene depend on multipliers."""
    return bool(system.kinds[FRICTION + 1] > system.kinds[FRICTION])


@compiled
def store_applied_forces(system: System) -> None:
    """Remember the scaled applied forces before they become accelerations."""
    copy(system.friction[: system.acceleration.size], system.acceleration)


@compiled
def apply_friction(t: float, system: System, loops: Any) -> float:
    """Forces for ``multipliers``, added to the scaled applied forces; returns their power."""
    forces, size, power = system.acceleration, system.acceleration.shape[0], 0.0
    applied, friction = system.friction[:size], system.friction[size : 2 * size]
    zero(friction)
    call_kinds(
        FRICTION, FRICTION, t, system, loops, friction, system.multipliers, system.multipliers
    )
    copy(forces, applied)
    for b in range(1, system.body.shape[0]):
        power = add_force(b, friction, forces, system, power)
    return power


def memory_size(bodies: int, rows: int, matrix: int) -> int:
    """Numbers of ``System.friction``.

    They are forces of the bodies (ground too), passes of the rows, 1.0 for each row that is read,
    0.0 for others; then weights of the rows and a copy of ``K`` (regularised.py).
    """
    return 12 * bodies + (5 + 2 * DEPTH) * rows + matrix


@compiled
def accelerate_fixed_point(system: System, passes: int) -> bool:
    """True if ``multipliers`` that are read have settled; else they start the next pass."""
    x, rows = system.multipliers, system.multipliers.shape[0]
    memory = system.friction[2 * system.force.shape[0] :]
    guess, result, change = memory[:rows], memory[rows : 2 * rows], memory[2 * rows : 3 * rows]
    if passes == 0:
        copy(guess, x)
        return False
    size, largest_change, is_read = 0.0, 0.0, memory[(3 + 2 * DEPTH) * rows :]
    for k in range(rows):
        of_all, of_change = abs(x[k]), is_read[k] * abs(x[k] - guess[k])
        size = where(of_all > size, of_all, size)
        largest_change = where(of_change > largest_change, of_change, largest_change)
    if not largest_change > SETTLED * size:
        return True
    if passes == PASSES:
        system.settings[UNSETTLED] += 1.0
        return True
    depth = DEPTH if system.settings[JAMS] != 0.0 else 1
    last = passes - 2
    while last >= depth:
        last -= depth
    if last >= 0:
        keep_difference(x, memory, last)
    for k in range(rows):
        result[k], change[k] = x[k], x[k] - guess[k]
    for q in range(last + 1):
        o = (3 + 2 * q) * rows
        share = projection(change, memory[o : o + rows])
        for k in range(rows):
            x[k] -= share * memory[o + rows + k]
    copy(guess, x)
    return False


@compiled
def keep_difference(x: Floats, memory: Floats, last: int) -> None:
    """Keep the differences from the pass before, of changes and results, as pair ``last``.

    Those of changes are made orthogonal to the earlier ones; where they depend on them nothing but
    rounding is left, which projections would magnify: the pair is zero.
    """
    rows = x.shape[0]
    guess, result, change = memory[:rows], memory[rows : 2 * rows], memory[2 * rows : 3 * rows]
    o = (3 + 2 * last) * rows
    mine, moved = memory[o : o + rows], memory[o + rows : o + 2 * rows]
    for k in range(rows):
        mine[k], moved[k] = x[k] - guess[k] - change[k], x[k] - result[k]
    whole = squares(mine)
    for q in range(last):
        o = (3 + 2 * q) * rows
        share = projection(mine, memory[o : o + rows])
        for k in range(rows):
            mine[k] -= share * memory[o + k]
            moved[k] -= share * memory[o + rows + k]
    if not squares(mine) > DIFFERENCE_ROUNDING * whole:
        zero(mine)
        zero(moved)


@compiled
def squares(a: Floats) -> float:
    """A . a."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * a[k]
    return total


@compiled
def projection(a: Floats, b: Floats) -> float:
    """A . b / b . b; zero where b is."""
    upper = lower = 0.0
    for k in range(b.shape[0]):
        upper += a[k] * b[k]
        lower += b[k] * b[k]
    return upper / lower if lower > 0.0 else 0.0


@compiled_into
def solve_with_friction(
    t: float, system: System, loops: Any, solve: Callable[[System], None]
) -> float:
    """``solve`` of a formulation, again until forces and multipliers agree; power of these forces.

    Not a number, which ends a run, where forces on reactions jam: they raise their own load by more
    than itself.

    solve: ``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``.
    """
    power, passes = 0.0, 0
    if has_friction(system):
        store_applied_forces(system)
    solve(system)
    if has_friction(system):
        unsettled = system.settings[UNSETTLED]
        while not accelerate_fixed_point(system, passes):
            passes += 1
            power = apply_friction(t, system, loops)
            solve(system)
        if system.settings[JAMS] != 0.0 and system.settings[UNSETTLED] > unsettled:
            return np.inf - np.inf
    return power
