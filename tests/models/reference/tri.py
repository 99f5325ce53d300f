"""Reference for the model `tri`: a tricycle with one speed.

On level ground the tricycle moves in the plane. Its front wheel rolls without slip in its own
direction, the left rear wheel does not slip along its axle, and the steering is prescribed, so the
speed u of the front wheel over the ground decides all velocities:

    frame: forwards u cos(delta), sideways 0.2 yaw_dot, yaw_dot = u sin(delta) / 0.7

with 0.7 m from the rear axle to the steering axis. Virtual power along u gives its rate. Nothing
turns the rear wheels about their axles, which slip forwards. The loads of the wheels are those that
Newton's law needs for this motion: 27 unknowns, 30 equations.
"""

from functools import cache

import numpy as np
from kkt import Body, Driver, Fixed, Joint, Moment, System, rev
from kkt_joints import disk
from rigid import Array, Trajectory, Z, product, rotation, turn

NAMES = ("frame", "fork", "front", "left", "right")
MASS = (20.0, 2.0, 1.0, 1.0, 1.0)
WHEEL = (0.01, 0.02, 0.01)
JP = ((0.9, 1.2, 1.8), (0.05, 0.05, 0.02), WHEEL, WHEEL, WHEEL)
PLACE = ((0.0, 0.0), (0.5, 0.0), (0.5, 0.0), (-0.2, 0.3), (-0.2, -0.3))  # in the frame
HEIGHT = (0.325, 0.325, 0.2, 0.2, 0.2)
RADIUS, TORQUE, BASE, BEHIND = 0.2, 2.0, 0.7, 0.2
STEERED = (1, 2)
Y = np.array([0.0, 1.0, 0.0])


def steering(t: float) -> tuple[float, float, float]:
    """Return delta and its derivatives: 0.3 rad at 2.5 s, zero before 1 s and after 4 s."""
    if not 1.0 < t < 4.0:
        return 0.0, 0.0, 0.0
    hump = 64 * 0.3 * np.polynomial.Polynomial([0, 1, -1]) ** 3  # of (t - 1) / 3
    x = (t - 1) / 3
    return hump(x), hump.deriv()(x) / 3, hump.deriv(2)(x) / 9


def speeds(t: float, u: float, u_dot: float) -> tuple[Array, Array]:
    """Return (forwards, sideways, yaw) of the frame: rates, in its axes, and their derivatives."""
    delta, delta_dot, _ = steering(t)
    yaw = u * np.sin(delta) / BASE
    yaw_dot = (u_dot * np.sin(delta) + u * np.cos(delta) * delta_dot) / BASE
    ahead_dot = u_dot * np.cos(delta) - u * np.sin(delta) * delta_dot
    rates = np.array([u * np.cos(delta), BEHIND * yaw, yaw])
    return rates, np.array([ahead_dot, BEHIND * yaw_dot, yaw_dot])


def body(k: int, t: float, u: float, u_dot: float) -> tuple[Array, Array, Array]:
    """Return velocity, its derivative by u, and acceleration of a body, in the axes of the frame.
    Third components are those of the yaw."""
    (ahead, side, yaw), (ahead_dot, side_dot, yaw_dot) = speeds(t, u, u_dot)
    x, y = PLACE[k]
    velocity = np.array([ahead - yaw * y, side + yaw * x, yaw])
    by_u = np.array([*(velocity[:2] / u), yaw / u]) if u else body(k, t, 1.0, 0.0)[1]
    acceleration = np.array(
        [
            ahead_dot - yaw_dot * y - yaw * velocity[1],
            side_dot + yaw_dot * x + yaw * velocity[0],
            yaw_dot,
        ]
    )
    if k in STEERED:
        _, delta_dot, delta_ddot = steering(t)
        velocity[2] += delta_dot
        acceleration[2] += delta_ddot
    return velocity, by_u, acceleration


def faster(t: float, u: float) -> float:
    """Return the rate of u [m/s^2]."""
    inertia = JP[2][1] / RADIUS**2
    power = TORQUE / RADIUS
    for k in range(5):
        _, by_u, rest = body(k, t, u, 0.0)
        weights = np.array([MASS[k], MASS[k], JP[k][2]])
        inertia += weights @ by_u**2
        power -= weights @ (by_u * rest)
    return power / inertia


@cache
def trajectory() -> Trajectory:
    """Return the motion of (x, y, yaw, angle of the front wheel, u)."""

    def rhs(t: float, q: Array) -> Array:
        u = q[4]
        ahead, side, yaw = speeds(t, u, 0.0)[0]
        c, s = np.cos(q[2]), np.sin(q[2])
        return np.array([c * ahead - s * side, s * ahead + c * side, yaw, u / RADIUS, faster(t, u)])

    return Trajectory(rhs, np.zeros(5))


def motion(t: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the five bodies."""
    x, y, yaw, rolled, u = trajectory().at(t)
    u_dot, delta = faster(t, u), steering(t)[0]
    A = rotation(turn(Z, yaw))
    parts = []
    for k in range(5):
        velocity, _, acceleration = body(k, t, u, u_dot)
        r = np.array([x, y, 0.0]) + A @ np.array([*PLACE[k], HEIGHT[k]])
        p = turn(Z, yaw + delta if k in STEERED else yaw)
        w, w_dot = velocity[2] * Z, acceleration[2] * Z
        if k == 2:
            axle = rotation(p) @ Y
            w_dot = w_dot + u_dot / RADIUS * axle + np.cross(w, u / RADIUS * axle)
            w = w + u / RADIUS * axle
            p = product(p, turn(Y, rolled))
        v, v_dot = (A @ np.array([*a[:2], 0.0]) for a in (velocity, acceleration))
        parts.append((r, p, np.concatenate([v, w]), np.concatenate([v_dot, w_dot])))
    r, p, v, v_dot = (np.array(x) for x in zip(*parts, strict=True))
    return r, p, v, v_dot


def system(rate: float = 0.0, torque: tuple[float, float, float] = (0.0, TORQUE, 0.0)) -> System:
    """Return the tricycle in space, steered at `rate`; `torque` on the front wheel, global axes."""
    bodies = [Body(NAMES[k], MASS[k], JP[k], (*PLACE[k], HEIGHT[k])) for k in range(5)]

    def axle(name: str, wheel: int, carrier: int, place: tuple[float, float, float]) -> Joint:
        y = (0.0, 1.0, 0.0)
        return rev(name, Fixed(wheel, (0.0, 0.0, 0.0)), Fixed(carrier, place), Fixed(wheel, y),
                   Fixed(carrier, y))  # fmt: skip

    up = (0.0, 0.0, 1.0)
    joints = [
        rev("J1", Fixed(1, (0.0, 0.0, 0.0)), Fixed(0, (0.5, 0.0, 0.0)), Fixed(1, up), Fixed(0, up)),
        axle("J2", 2, 1, (0.0, 0.0, -0.125)),
        axle("J3", 3, 0, (-0.2, 0.3, -0.125)),
        axle("J4", 4, 0, (-0.2, -0.3, -0.125)),
        disk("J6", 2, RADIUS, "xyz"),
        disk("J7", 3, RADIUS, "zn"),
        disk("J8", 4, RADIUS, "z"),
    ]
    return System(bodies, joints, driver=Driver("J5", 0, Fixed(1, up), rate),
                  moments=[Moment(2, torque)])  # fmt: skip


SYSTEM = system()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    r, p, v, v_dot = motion(t)
    torque = tuple(rotation(p[2]) @ (TORQUE * Y))
    steered = system(steering(t)[1], torque)
    return SYSTEM.counts | steered.quantities(r, p, v.ravel(), v_dot.ravel())
