"""Accelerations where rows may depend on each other, by rows of finite weight (lsq.py)."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import EVEN, LENGTH, WEAK, Floats, System
from dap3d_core.assembly.evaluate import copy, global_accelerations, largest, zero
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.friction import has_friction
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where
from dap3d_core.linear.ldlt.factor import weigh_rows

#: How often the rows are solved.
SOLVES = 3
#: The same, at most, where masses differ much; and how much less of a residual a pass is to leave.
MORE_SOLVES, FALLING = 12, 0.5
#: What passes may leave of the rows, as a part of the largest acceleration; how much smaller parts
#: are where they leave more, and how much of it these are to take away; the least part.
ROUGH, WEAKER, LESS, WEAKEST = 1e-11, 1e-2, 0.1, 1e-13
#: For the least multipliers: e w as part of the longest row's square, and passes at most. D^T may
#: see this part of what is taken away; else e is smaller, by so much at a time, to a least one.
LEAST_PART, LEAST_SOLVES = 1e-4, 50
SEEN, SMALLER, SMALLEST = 1e-11, 1e-2, 1e-4
#: Passes end where what is left is this part of the multipliers: no digit of them reads it.
NOTHING = 1e-20


@compiled
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled ``acceleration`` and ``multipliers``; returns the power of forces and drivers."""
    return constraints.solve_equations(t, y, system, loops, constraints.PART, solve)


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``.

    Each pass starts from the accelerations of the one before, so that it solves for what is left;
    ``total`` is the sum of the passes. Where masses differ much a row may weigh more than the
    bodies that it joins: passes continue while each leaves much less of the rows.
    """
    zero(system.total)
    for _ in range(SOLVES):
        add_pass(system)
    left = 0.0
    if system.settings[EVEN] != 0.0 or system.settings[WEAK] != 0.0:
        left = add_passes(system)
    if system.settings[WEAK] != 0.0:
        solve_weak_rows(system, left)
    copy(system.multipliers, system.total)
    if has_friction(system):
        least_multipliers(system)


@compiled
def add_passes(system: System) -> float:
    """Passes, while each leaves much less of the rows; what is left, m/s^2."""
    left, passes = constraints.acceleration_residual(system), 0
    before = np.inf
    while passes < MORE_SOLVES and left < FALLING * before:
        add_pass(system)
        before, left = left, constraints.acceleration_residual(system)
        passes += 1
    return left


@compiled
def size_of_accelerations(system: System) -> float:
    """The largest acceleration, m/s^2, those of rotation times the length of the scene."""
    v_dot, length, size = system.velocity, system.settings[LENGTH], 0.0
    global_accelerations(system.metric, system.acceleration, v_dot)
    for k in range(6 * (system.metric.shape[0] - 1)):
        part = abs(v_dot[k]) * (1.0 if k % 6 < 3 else length)
        size = where(part > size, part, size)
    return size


@compiled
def solve_weak_rows(system: System, left: float) -> None:
    """Solve for what passes have ``left``, by factors of smaller parts.

    Rows that move light bodies, or such that turn easily, much more than the others that they join
    are independent by little, of which passes leave nearly all. Rows that contradict each other
    leave as much by any part, and their multipliers are the larger the smaller it is: the passes
    before are taken.
    """
    limit = ROUGH * size_of_accelerations(system)
    if not left > limit:
        return
    best, total, part = system.velocity, system.right_side, constraints.PART
    copy(best, system.acceleration)
    copy(total, system.total)
    while left > limit and part > WEAKEST:
        part *= WEAKER
        constraints.factorise(system, part)
        now = add_passes(system)
        if now < LESS * left:
            left = now
            copy(best, system.acceleration)
            copy(total, system.total)
    copy(system.acceleration, best)
    copy(system.total, total)
    constraints.factorise(system, constraints.PART)


@compiled
def least_multipliers(system: System) -> None:
    """Replace ``multipliers`` by those with the same D^T lambda of least lambda . w lambda.

    So forces read numbers that are free of rounding. n -> (D^ D^^T + e w)^-1 e w n keeps what D^T
    does not see, and takes away the rest: with one factorisation, and fewer where e is small
    enough for rows that hold only weakly.
    """
    K, n, rows = system.K, system.right_side, system.total.shape[0]
    last = system.friction.shape[0] - K.shape[0]
    w, kept = system.friction[last - rows : last], system.friction[last:]
    copy(kept, K)
    weigh_rows(system.blocks, system.D, 1.0, system.compliance)
    e = LEAST_PART * largest(system.compliance) / largest(w)
    for k in range(rows):
        n[k] = system.total[k] = system.multipliers[k]
    limit, smallest = SEEN * largest(system.total), SMALLEST * e
    while take_seen(system, n, w, e) > limit and e > smallest:
        e *= SMALLER
    copy(K, kept)
    for k in range(rows):
        system.multipliers[k] = system.total[k] - n[k]


@compiled
def take_seen(system: System, n: Floats, w: Floats, e: float) -> float:
    """Take from n what D^T sees, as far as weights e w do; the largest change of the last pass."""
    x, before, change = system.multipliers, np.inf, np.inf
    nothing = NOTHING * largest(system.total)
    for k in range(n.shape[0]):
        system.compliance[k] = e * w[k]
    constraints.factorise_regularised(system)
    for _ in range(LEAST_SOLVES):
        for k in range(n.shape[0]):
            x[k] = e * w[k] * n[k]
        zero(system.change)
        constraints.solve_rows(system, system.change)
        change = 0.0
        for k in range(n.shape[0]):
            x[k] = -x[k] if w[k] != 0.0 else 0.0  # else a hub's place
            change = max(change, abs(x[k] - n[k]))
            n[k] = x[k]
        if not change < 0.5 * before or change <= nothing:
            break
        before = change
    return change


@compiled
def add_pass(system: System) -> None:
    """Solve for what the accelerations leave of the rows; ``total`` takes the change of -lambda."""
    multipliers, total = system.multipliers, system.total
    copy(multipliers, system.gamma)
    constraints.solve_rows(system, system.acceleration)
    for k in range(total.shape[0]):
        total[k] += multipliers[k]
