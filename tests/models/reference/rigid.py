"""Rotations, springs and a careful integration: what the reference simulators share.
Nothing here comes from the program under test. Quaternions are p = (e0, e1, e2, e3), body to
ground; vectors are numpy arrays of length 3; SI units."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
GRAVITY = 9.81
Z = np.array([0.0, 0.0, 1.0])


def cross(a: Array, b: Array) -> Array:
    """Return a x b along the first axis (numpy's own is ten times slower on small arrays)."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def rotation(p: Array) -> Array:
    """Return the rotation matrix of the quaternion `p`, which need not be of unit length."""
    e0, e1, e2, e3 = (p / np.sqrt(p @ p)).tolist()
    return np.array(
        [
            [1 - 2 * (e2 * e2 + e3 * e3), 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)],
            [2 * (e1 * e2 + e0 * e3), 1 - 2 * (e1 * e1 + e3 * e3), 2 * (e2 * e3 - e0 * e1)],
            [2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), 1 - 2 * (e1 * e1 + e2 * e2)],
        ]
    )


def product(a: Array, b: Array) -> Array:
    """Return the quaternion product a o b."""
    a0, a1, a2, a3 = a.tolist()
    b0, b1, b2, b3 = b.tolist()
    return np.array(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + b0 * a1 + a2 * b3 - a3 * b2,
            a0 * b2 + b0 * a2 + a3 * b1 - a1 * b3,
            a0 * b3 + b0 * a3 + a1 * b2 - a2 * b1,
        ]
    )


def quaternion_rate(p: Array, w: Array) -> Array:
    """Return dp/dt for the angular velocity `w` in global axes [rad/s]."""
    return 0.5 * product(np.concatenate([[0.0], w]), p)


def turn(axis: Array, angle: float) -> Array:
    """Return the quaternion of a turn by `angle` [rad] about the unit vector `axis`."""
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])


def spring(
    tail: Array, tail_dot: Array, head: Array, head_dot: Array, k: float, c: float, length: float
) -> tuple[Array, float]:
    """Return force on the tail [N] and potential energy [J] of a spring."""
    d, d_dot = head - tail, head_dot - tail_dot
    now = np.linalg.norm(d)
    u = d / now
    rate = u @ d_dot
    stretch = now - length
    return (k * stretch + c * rate) * u, 0.5 * k * stretch**2


class Trajectory:
    """The solution of y' = rhs(t, y), y(0) = y0, at any instants that are asked for.
    Every instant is the end of a step: the dense output of DOP853 is of lower order than its
    steps and would cost digits. States already known are the starting points of later ones."""

    def __init__(
        self,
        rhs: Callable[[float, Array], Array],
        y0: Array,
        rtol: float = 1e-13,
        atol: float = 1e-15,
    ) -> None:
        self.rhs, self.rtol, self.atol = rhs, rtol, atol
        self.known = {0.0: np.asarray(y0, float)}

    def at(self, t: float) -> Array:
        """Return the state at `t` >= 0."""
        start = max(x for x in self.known if x <= t)
        if start < t:
            settings = {"method": "DOP853", "rtol": self.rtol, "atol": self.atol}
            run = solve_ivp(self.rhs, (start, t), self.known[start], **settings)
            if not run.success or not np.all(np.isfinite(run.y[:, -1])):
                raise ArithmeticError(f"reference integration stopped before t = {t}")
            self.known[t] = run.y[:, -1]
        return self.known[t]
