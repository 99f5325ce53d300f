"""Reference for the model `two_link_arm`: Lagrange's equations in two angles, by SciPy."""

from functools import cache

import numpy as np
from rigid import Array
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

L, M, J, GRAVITY = 0.5, (2.0, 1.5), (0.04, 0.03), 9.81
TARGET, DAMPING = np.radians([30.0, 60.0]), np.array([6.0, 1.5])
HALF = np.array([0.25, 0.5, 1.0, 2.0, 4.0])
ERRORS = np.concatenate([-HALF[::-1], [0.0], HALF])
TORQUES = np.concatenate([[-30, -30, -30, -27, -18, 0], [18, 27, 30, 30, 30]])
STRONG = CubicSpline(ERRORS, TORQUES, bc_type="natural")


def _rate(_: float, y: Array) -> Array:
    """Return the rates of (q1, q2) and their speeds; q2 is counted from the upper link."""
    q, u = y[:2], y[2:]
    c, s = np.cos(q[1]), np.sin(q[1])
    h = 0.5 * L
    m11 = J[0] + M[0] * h * h + J[1] + M[1] * (L * L + h * h + 2.0 * L * h * c)
    m12 = J[1] + M[1] * (h * h + L * h * c)
    m22 = J[1] + M[1] * h * h
    bent = M[1] * L * h * s
    lower = M[1] * GRAVITY * h * np.cos(q[0] + q[1])
    upper = (M[0] * h + M[1] * L) * GRAVITY * np.cos(q[0])
    torque = -STRONG(q - TARGET) * [1.0, 1.0 / 3.0] - DAMPING * u
    right = (
        torque - [upper + lower, lower] + bent * np.array([u[1] * (2 * u[0] + u[1]), -(u[0] ** 2)])
    )
    return np.concatenate([u, np.linalg.solve([[m11, m12], [m12, m22]], right)])


@cache
def _state(t: float) -> tuple[float, ...]:
    """Return angles and speeds at `t`."""
    start = [-0.5 * np.pi, 0.0, 0.0, 0.0]
    found = solve_ivp(_rate, (0.0, t), start, "DOP853", rtol=1e-12, atol=1e-13)
    return tuple(found.y[:, -1])


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    q1, q2, u1, u2 = _state(t)
    upper, lower = np.exp(1j * q1), np.exp(1j * (q1 + q2))
    hand = L * (upper + lower)
    hand_dot = 1j * L * (u1 * upper + (u1 + u2) * lower)
    return {
        "rP.hand": np.array([0.0, hand.real, hand.imag]),
        "rPd.hand": np.array([0.0, hand_dot.real, hand_dot.imag]),
        "w.upper": np.array([u1, 0.0, 0.0]),
        "w.lower": np.array([u1 + u2, 0.0, 0.0]),
    }
