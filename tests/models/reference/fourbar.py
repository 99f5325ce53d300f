"""The driven spatial four-bar in closed form: what `fourbar3.py` and `fourbar2.py` share.
The crank angle is alpha = -2 pi t about +x: the driver prescribes the angular velocity of j (the
ground) relative to i (the crank), so the crank turns backwards. T is the crank tip and
B = O + 7 e(phi), e = cos(phi) z + sin(phi) u, the follower tip. The loop closes at |B - T| = 6.4,
linear in (cos phi, sin phi). Velocities and accelerations follow by differentiating it."""

from typing import NamedTuple

import numpy as np
from rigid import Array, Trajectory, Z, quaternion_rate, turn

CRANK, COUPLER, FOLLOWER = 2.0, 6.4, 7.0
RATE = 2 * np.pi  # f_dot of the driver; the crank turns at -RATE
PIVOT = np.array([0.0, 4.0, 0.0])
X = np.array([1.0, 0.0, 0.0])
H = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)  # axis of the follower's revolute joint
U = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)  # where the follower leans for phi > 0
COUPLER_P0 = (0.94372914762729, -0.3307191304138, 0.0003687760074, -0.00012923335132)


class Branch(NamedTuple):
    """A vector and its first two derivatives."""

    x: Array
    dx: Array
    ddx: Array


def crank_tip(t: float) -> Branch:
    """Return the crank tip."""
    angle = RATE * t
    x = CRANK * np.array([0.0, np.sin(angle), np.cos(angle)])
    dx = CRANK * RATE * np.array([0.0, np.cos(angle), -np.sin(angle)])
    return Branch(x, dx, -(RATE**2) * x)


def follower_angle(t: float) -> tuple[float, float, float]:
    """Return phi, phi_dot and phi_ddot, on the branch that starts near phi = 0.
    2 * 7 (O - T).e(phi) = 6.4^2 - 7^2 - |O - T|^2 reads a cos(phi) + b sin(phi) = c."""
    T, T_dot, T_ddot = crank_tip(t)
    w = PIVOT - T
    a, b = w @ Z, w @ U
    c = (COUPLER**2 - FOLLOWER**2 - w @ w) / (2 * FOLLOWER)
    phi = np.arctan2(b, a) - np.arccos(c / np.hypot(a, b))
    e, e_dash = np.cos(phi) * Z + np.sin(phi) * U, -np.sin(phi) * Z + np.cos(phi) * U
    D = w + FOLLOWER * e
    rate = D @ T_dot / (FOLLOWER * D @ e_dash)
    D_dot = FOLLOWER * rate * e_dash - T_dot
    second = D @ (T_ddot + FOLLOWER * rate**2 * e) - D_dot @ D_dot
    return phi, rate, second / (FOLLOWER * D @ e_dash)


def follower_axis(t: float) -> Branch:
    """Return the unit vector from the follower's pivot to its tip."""
    phi, rate, second = follower_angle(t)
    e, e_dash = np.cos(phi) * Z + np.sin(phi) * U, -np.sin(phi) * Z + np.cos(phi) * U
    return Branch(e, rate * e_dash, second * e_dash - rate**2 * e)


def crank(t: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the crank."""
    T = crank_tip(t)
    rates = np.concatenate([T.dx / 2, -RATE * X])
    return T.x / 2, turn(X, -RATE * t), rates, np.concatenate([T.ddx / 2, np.zeros(3)])


def follower(t: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the follower, which turns by -phi about H."""
    phi, rate, second = follower_angle(t)
    half, half_dot, half_ddot = (FOLLOWER / 2 * x for x in follower_axis(t))
    rates = np.concatenate([half_dot, -rate * H])
    return PIVOT + half, turn(H, -phi), rates, np.concatenate([half_ddot, -second * H])


def coupler_axis(t: float) -> Branch:
    """Return the unit vector along the coupler, crank tip to follower tip."""
    tip = [FOLLOWER * x for x in follower_axis(t)]
    tip[0] = tip[0] + PIVOT
    return Branch(*((b - a) / COUPLER for a, b in zip(crank_tip(t), tip, strict=True)))


def _coupler_rate(t: float, p: Array) -> Array:
    a = coupler_axis(t)
    return quaternion_rate(p, np.cross(a.x, a.dx))


COUPLER_TURN = Trajectory(_coupler_rate, np.array(COUPLER_P0))


def coupler(t: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the coupler.
    Its spin about its own line is the one freedom left. It starts without spin (minimum-norm
    velocities), nothing turns it about that line and its transverse inertias are equal, so it never
    spins: w = a x a_dot. Its pose p therefore needs one quadrature."""
    T, a = crank_tip(t), coupler_axis(t)
    r, v, v_dot = (x + COUPLER / 2 * y for x, y in zip(T, a, strict=True))
    rates = np.concatenate([v, np.cross(a.x, a.dx)])
    return r, COUPLER_TURN.at(t), rates, np.concatenate([v_dot, np.cross(a.x, a.ddx)])


SPRING_K, SPRING_LENGTH = 50.0, 8.0  # follower tip to the origin
