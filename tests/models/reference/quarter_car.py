"""Reference for the model `quarter_car`: two coordinates, by SciPy.
The height of the chassis and the angle of the lower arm are the coordinates. The loop of the
wishbones and the tie rod closes for an angle in closed form; polynomials through poses at
Chebyshev's points are differentiated for the first and second derivatives. Virtual power of all
forces and of the masses' accelerations gives the motion."""

from functools import cache

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebinterpolate, chebval
from rigid import GRAVITY, Array
from scipy.integrate import solve_ivp

# places at the start, seen from the chassis
CHASSIS = np.array([0.0, 0.0, 0.55])
LOWER_HINGE, UPPER_HINGE = np.array([0.0, 0.3, -0.33]), np.array([0.0, 0.38, -0.1])
LOWER_BALL, UPPER_BALL = np.array([0.01, 0.7, -0.36]), np.array([-0.02, 0.66, -0.08])
RACK, LEVER = np.array([-0.12, 0.33, -0.29]), np.array([-0.13, 0.69, -0.3])
STRUT_TOP, STRUT_FOOT = np.array([0.0, 0.44, 0.1]), np.array([0.0, 0.6, -0.34])
CENTRES = np.array([[0.0, 0.5, -0.34], [0.0, 0.52, -0.09], [0.0, 0.76, -0.25]])
MASSES, CAR = np.array([5.0, 3.0, 40.0]), 350.0
INERTIAS = np.array([[0.08, 0.03, 0.1], [0.03, 0.015, 0.04], [1.0, 1.6, 1.0]])
K, C, STRUT = 45e3, 3000.0, 0.5824025
TYRE_K, TYRE_C, TYRE = 200e3, 200.0, 0.3 + 0.0195219
BUMP, START, LENGTH = 0.05, 0.2, 0.2
#: Angles of the lower arm, rad, and the degree of the polynomials: 1e-14 of each pose.
RANGE, DEGREE = 0.25, 32


def cross_matrix(v: Array) -> Array:
    """Return the matrix that multiplies by v x."""
    return np.cross(np.eye(3), v)


def about(axis: Array, angle: float) -> Array:
    """Return the rotation matrix of a turn (Rodrigues)."""
    k = cross_matrix(axis)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def closing_angle(axis: Array, arm: Array, to: Array, distance: float) -> float:
    """Return the smaller turn of `arm` that brings its tip to a distance from `to`.
    |R arm - to|^2 is a + b cos + c sin of the angle."""
    along = axis * (axis @ arm)
    b, c = -2.0 * to @ (arm - along), -2.0 * to @ np.cross(axis, arm)
    a = arm @ arm + to @ to - 2.0 * to @ along
    half = np.arccos((distance**2 - a) / np.hypot(b, c))
    both = np.arctan2(c, b) + np.array([half, -half])
    both = (both + np.pi) % (2.0 * np.pi) - np.pi
    return float(both[np.argmin(np.abs(both))])


def pose(q: float) -> Array:
    """Return places (3, 3), rotations (3, 3, 3) of arms and upright and the strut's foot, flat."""
    x = np.array([1.0, 0.0, 0.0])
    lower = about(x, q)
    ball = LOWER_HINGE + lower @ (LOWER_BALL - LOWER_HINGE)
    pin = UPPER_BALL - LOWER_BALL
    turn = closing_angle(x, UPPER_BALL - UPPER_HINGE, ball - UPPER_HINGE, np.linalg.norm(pin))
    upper = about(x, turn)
    now = UPPER_HINGE + upper @ (UPPER_BALL - UPPER_HINGE) - ball
    kingpin = now / np.linalg.norm(now)
    k = cross_matrix(np.cross(pin / np.linalg.norm(pin), kingpin))
    # the least turn that brings the kingpin there, then one about it
    leaned = np.eye(3) + k + k @ k / (1.0 + pin @ now / (pin @ pin))
    rod = np.linalg.norm(LEVER - RACK)
    steer = closing_angle(kingpin, leaned @ (LEVER - LOWER_BALL), RACK - ball, rod)
    upright = about(kingpin, steer) @ leaned
    places = [
        LOWER_HINGE + lower @ (CENTRES[0] - LOWER_HINGE),
        UPPER_HINGE + upper @ (CENTRES[1] - UPPER_HINGE),
        ball + upright @ (CENTRES[2] - LOWER_BALL),
    ]
    foot = LOWER_HINGE + lower @ (STRUT_FOOT - LOWER_HINGE)
    return np.concatenate([np.ravel(x) for x in (*places, lower, upper, upright, foot)])


@cache
def polynomials() -> tuple[Array, Array, Array]:
    """Return coefficients of the pose over angle / RANGE, and of its derivatives."""
    value = chebinterpolate(lambda x: np.array([pose(RANGE * one) for one in x]), DEGREE)
    return value, chebder(value) / RANGE, chebder(value, 2) / RANGE**2


def vector_of(m: Array) -> Array:
    """Return the vectors of the skew parts of matrices."""
    skew = 0.5 * (m - np.swapaxes(m, -1, -2))
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)


def kinematics(q: float) -> tuple[Array, ...]:
    """Return places and rotations, both with derivatives, turning rates, and that of the strut."""
    if abs(q) > RANGE:
        raise ArithmeticError("the arm is beyond its polynomials")
    r, r_1, r_2 = (chebval(q / RANGE, c) for c in polynomials())
    A, A_1, A_2 = (x[9:36].reshape(3, 3, 3) for x in (r, r_1, r_2))
    to, turned = np.swapaxes(A, 1, 2), (A_1, A_2)
    w_1, w_2 = (vector_of(x @ to) for x in turned)  # w = w_1 q', its rate w_1 q'' + w_2 q'^2
    places = (x[:9].reshape(3, 3) for x in (r, r_1, r_2))
    return (*places, A, w_1, w_2, r[36:] - STRUT_TOP, r_1[36:])


def road(t: float) -> tuple[float, float]:
    """Return height and speed of the plate: u^3 (1 - u)^3 and slope, 1/64 in the middle."""
    u = np.clip((t - START) / LENGTH, 0.0, 1.0)
    first = 3.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u) / LENGTH
    return 64.0 * BUMP * (u * (1.0 - u)) ** 3, 64.0 * BUMP * first


def tyre_force(t: float, y: Array) -> float:
    """Return the force on the wheel, upwards."""
    r, r_1 = kinematics(y[1])[:2]
    height, speed = road(t)
    bend = CHASSIS[2] + y[0] + r[2, 2] - height - TYRE
    return -TYRE_K * bend - TYRE_C * (y[2] + r_1[2, 2] * y[3] - speed)


def rate(t: float, y: Array) -> Array:
    """Return the rates of (z, q) and their speeds."""
    u = y[2:]
    _, r_1, r_2, A, w_1, w_2, strut, strut_1 = kinematics(y[1])
    J = np.stack([np.tile([0.0, 0.0, 1.0], (3, 1)), r_1], axis=-1)
    inertia = A * INERTIAS[:, None, :] @ np.swapaxes(A, 1, 2)
    mass = np.einsum("nki,nkj,n->ij", J, J, MASSES)
    mass[0, 0] += CAR
    mass[1, 1] += np.einsum("nk,nkl,nl->", w_1, inertia, w_1)
    w = w_1 * u[1]
    spin = np.einsum("nkl,nl->nk", inertia, w)
    rest = np.einsum("nkl,nl->nk", inertia, w_2 * u[1] ** 2) + np.cross(w, spin)
    left = np.einsum("nki,nk,n->i", J, r_2 * u[1] ** 2 + [0.0, 0.0, GRAVITY], MASSES)
    left[0] += CAR * GRAVITY
    left[1] += np.einsum("nk,nk->", w_1, rest)
    length = np.linalg.norm(strut)
    stretch = strut @ strut_1 / length
    right = tyre_force(t, y) * J[2, 2] - left
    right[1] -= (K * (length - STRUT) + C * stretch * u[1]) * stretch
    return np.concatenate([u, np.linalg.solve(mass, right)])


@cache
def state(t: float) -> Array:
    """Return coordinates and speeds at `t`; steps end where the bump begins and ends."""
    y, now = np.zeros(4), 0.0
    for end in [x for x in (START, START + LENGTH) if x < t] + [t]:
        run = solve_ivp(rate, (now, end), y, "DOP853", rtol=1e-12, atol=1e-13)
        y, now = run.y[:, -1], end
    return y


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    y = state(t)
    r, r_1, _, _, w_1, *_ = kinematics(y[1])
    up = np.array([0.0, 0.0, 1.0])
    return {
        "r.chassis": CHASSIS + y[0] * up,
        "rd.chassis": y[2] * up,
        "r.upright": CHASSIS + y[0] * up + r[2],
        "rd.upright": y[2] * up + r_1[2] * y[3],
        "w.upright": w_1[2] * y[3],
        "w.upper_arm": w_1[1] * y[3],
    }
