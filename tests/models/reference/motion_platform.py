"""Reference for the model `motion_platform`: closure of the legs by iteration, forces by J^-T.
With the rows u_k . (v + w x s_k) = l_k_dot of the six legs the pose follows from the lengths, and
velocities and accelerations from their rates. The legs have no mass: their six forces together are
what Newton's and Euler's law ask for."""

import numpy as np
from rigid import Array
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

MASS, INERTIA, GRAVITY = 400.0, np.diag([60.0, 60.0, 110.0]), 9.81
STROKE, OMEGA, HEIGHT = 0.12, np.pi, 1.0
LEGS = np.arange(6)


def _circle(radius: float, degrees: Array) -> Array:
    """Return points of a circle in the x-y plane, (6, 3)."""
    angle = np.radians(degrees)
    return radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


FEET = _circle(1.2, 120 * (LEGS // 2) + np.where(LEGS % 2, 10, -10))
HEADS = _circle(0.8, 120 * (LEGS // 2) + np.where(LEGS % 2, 50, -50))
PHASE = -np.radians(60.0 * LEGS)
LENGTH_0 = np.linalg.norm(HEADS + np.array([0.0, 0.0, HEIGHT]) - FEET, axis=1)


def _legs(pose: Array) -> tuple[Array, Array]:
    """Return the arms of the heads and the legs as vectors, of a position and a rotation vector."""
    arms = Rotation.from_rotvec(pose[3:]).apply(HEADS)
    return arms, pose[:3] + arms - FEET


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    length = LENGTH_0 + STROKE * (np.sin(OMEGA * t + PHASE) - np.sin(PHASE))
    rate = STROKE * OMEGA * np.cos(OMEGA * t + PHASE)
    second = -STROKE * OMEGA**2 * np.sin(OMEGA * t + PHASE)

    def open_(pose: Array) -> Array:
        return np.linalg.norm(_legs(pose)[1], axis=1) - length

    pose = fsolve(open_, np.array([0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0]), xtol=1e-14)
    arms, legs = _legs(pose)
    u = legs / length[:, None]
    J = np.hstack([u, np.cross(arms, u)])
    velocity = np.linalg.solve(J, rate)
    w = velocity[3:]
    d_dot = velocity[:3] + np.cross(w, arms)
    bent = (np.sum(d_dot**2, axis=1) - rate**2) / length
    bent += np.sum(u * np.cross(w, np.cross(w, arms)), axis=1)
    acceleration = np.linalg.solve(J, second - bent)
    A = Rotation.from_rotvec(pose[3:])
    I = A.as_matrix() @ INERTIA @ A.as_matrix().T
    force = MASS * (acceleration[:3] + np.array([0.0, 0.0, GRAVITY]))
    moment = I @ acceleration[3:] + np.cross(w, I @ w)
    push = np.linalg.solve(J.T, np.concatenate([force, moment]))
    x, y, z, scalar = A.as_quat()
    found = {f"lambda.leg{k + 1}": push[[k]] / length[k] for k in LEGS}
    return found | {
        "r.platform": pose[:3],
        "p.platform": np.array([scalar, x, y, z]),
        "rd.platform": velocity[:3],
        "w.platform": w,
    }
