"""Steps towards a stable equilibrium: Newton's, within a radius, against the forces' resistance.

The step y of the freedoms solves (K + mu I) y = g with the unbalanced forces g and the least
mu >= 0 for which K + mu I is positive definite and |y| no longer than the radius (Moré and Sorensen
1983). It is an implicit Euler step of the motion without inertia that a damper of mu on all
freedoms leads to; with mu = 0 it is Newton's. Freedoms that nothing pushes along and that no
stiffness holds stay where they are, as in that motion, unless a step is to leave an unstable
equilibrium.
"""

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats

#: A stiffness below this part of the largest is none: rounding errors of K.
NEUTRAL = 1e-11
#: A part of the unbalanced forces below this is none.
BALANCED = 1e-9
#: mu is found to this part of the radius.
FIT = 0.1


@attrs.frozen(eq=False)
class Step:
    """A step of the freedoms.

    Attributes:
        y: (f,) the step.
        gain: work of the forces that K predicts, N m.
        is_newton: mu is zero.
    """

    y: Floats
    gain: float
    is_newton: bool


def trust_region_step(
    K: Floats, g: Floats, size: float, radius: float, *, leaves: bool = False
) -> Step:
    """The step from unbalanced forces g (f,) with stiffness K (f, f).

    Args:
        K, g: of the freedoms, scaled.
        size: of forces, N m: a part of it is zero.
        radius: largest length of y.
        leaves: along a negative stiffness, though nothing pushes that way.
    """
    symmetric = 0.5 * (K + K.T)
    w, Q = np.linalg.eigh(symmetric)
    share, zero = Q.T @ g, zero_stiffness(w, size)
    held = np.abs(w) > zero if leaves else w > zero
    idle = ~held & (np.abs(share) <= BALANCED * size / np.sqrt(max(len(share), 1)))
    w, Q, share = w[~idle], Q[:, ~idle], share[~idle]
    if not len(w):
        return Step(np.zeros_like(g), 0.0, True)
    lowest = float(w[0])
    own = Q.T @ K @ Q
    if lowest > zero:
        y = Q @ np.linalg.solve(own, share)
        if np.linalg.norm(y) <= radius:
            return Step(y, _gain(K, g, y), True)
    floor = max(0.0, -lowest) + zero
    if lowest <= zero and _length(share, w, floor) < radius:  # the hard case
        z = share / (w + floor)
        rest = np.sqrt(max(radius**2 - float(z @ z), 0.0))
        z[0] += rest if z[0] >= 0.0 else -rest
        y = Q @ z
        return Step(y, _gain(symmetric, g, y), False)
    mu = _damping(share, w, floor, radius)
    y = Q @ np.linalg.solve(own + mu * np.eye(len(w)), share)
    y *= min(1.0, radius / float(np.linalg.norm(y)))
    return Step(y, _gain(K, g, y), False)


def zero_stiffness(w: Floats, size: float) -> float:
    """The stiffness below which one of all, w (f,), is none; size: of forces, N m."""
    return NEUTRAL * max(float(np.max(np.abs(w), initial=0.0)), size)


def held_solution(matrix: Floats, side: Floats, size: float) -> Floats:
    """The least solution of equations of stiffness, without directions that none holds.

    size: of forces, N m: a part of it is zero.
    """
    left, values, right = np.linalg.svd(matrix)
    held = values > zero_stiffness(values, size)
    return right[held].T @ ((left.T @ side)[held] / values[held])


def _gain(K: Floats, g: Floats, y: Floats) -> float:
    return float(g @ y - 0.5 * y @ K @ y)


def _length(share: Floats, w: Floats, mu: float) -> float:
    return float(np.linalg.norm(share / (w + mu)))


def _damping(share: Floats, w: Floats, floor: float, radius: float) -> float:
    """The mu above a floor at which the step is as long as the radius."""
    low, high = floor, float(np.linalg.norm(share)) / radius + floor
    if _length(share, w, low) <= radius:
        return low
    for _ in range(200):
        mu = np.sqrt(low * high) if low > 0.0 and high > 4.0 * low else 0.5 * (low + high)
        length = _length(share, w, mu)
        if abs(length - radius) <= FIT * radius:
            break
        low, high = (mu, high) if length > radius else (low, mu)
    return float(mu)
