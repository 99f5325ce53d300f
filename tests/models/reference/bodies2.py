"""Reference for the model `bodies2`: two free bodies, two spring-dampers, weight.
Newton-Euler with Euler parameters and the global angular velocity."""

from functools import cache

import numpy as np
from rigid import GRAVITY, Array, Trajectory, Z, cross, quaternion_rate, rotation, spring

NAMES = ("upper", "lower")
MASS = (1.5, 2.0)
JP = (np.diag([0.06, 0.06, 0.06]), np.diag([0.1, 0.1, 0.1]))
R0 = (np.array([-0.5, 0.0, 1.5]), np.array([-0.5, 1.2, 0.5]))
Q = np.array([0.0, 0.0, 3.0])  # on the ground
A_LOCAL = np.array([0.5, 0.0, 0.0])  # on the upper body
B_LOCAL = np.array([0.0, 0.6, 0.0])  # on the upper body
C_LOCAL = np.array([0.0, -0.6, 0.0])  # on the lower body
K, DAMPING, LENGTHS = 100.0, 2.0, (1.5, 1.0)


def loads(r: Array, A: Array, v: Array, w: Array) -> tuple[Array, Array, float]:
    """Return forces, moments about the mass centres and potential energy."""
    a, b, c = A[0] @ A_LOCAL, A[0] @ B_LOCAL, A[1] @ C_LOCAL
    a_dot, b_dot = v[0] + cross(w[0], a), v[0] + cross(w[0], b)
    c_dot = v[1] + cross(w[1], c)
    F1, V1 = spring(r[0] + a, a_dot, Q, np.zeros(3), K, DAMPING, LENGTHS[0])
    F2, V2 = spring(r[0] + b, b_dot, r[1] + c, c_dot, K, DAMPING, LENGTHS[1])
    weight = [-m * GRAVITY * Z for m in MASS]
    force = np.array([F1 + F2 + weight[0], -F2 + weight[1]])
    moment = np.array([cross(a, F1) + cross(b, F2), -cross(c, F2)])
    potential = V1 + V2 + sum(m * GRAVITY * x[2] for m, x in zip(MASS, r, strict=True))
    return force, moment, potential


def accelerations(r: Array, A: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """Return the accelerations of the mass centres and the angular accelerations, global axes."""
    force, moment, _ = loads(r, A, v, w)
    J = [A[i] @ JP[i] @ A[i].T for i in (0, 1)]
    w_dot = [np.linalg.solve(J[i], moment[i] - cross(w[i], J[i] @ w[i])) for i in (0, 1)]
    return force / np.array(MASS)[:, None], np.array(w_dot)


def unpack(y: Array) -> tuple[Array, Array, Array, Array]:
    """Return r, p, v and w, one row a body, of the state of `quaternions`."""
    r, p = y[0:6].reshape(2, 3), y[6:14].reshape(2, 4)
    return r, p, y[14:20].reshape(2, 3), y[20:26].reshape(2, 3)


@cache
def quaternions(rtol: float = 1e-13, atol: float = 1e-15) -> Trajectory:
    """Return the motion of (r, p, v, w)."""

    def rhs(_: float, y: Array) -> Array:
        r, p, v, w = unpack(y)
        A = np.array([rotation(x) for x in p])
        v_dot, w_dot = accelerations(r, A, v, w)
        p_dot = [quaternion_rate(p[i], w[i]) for i in (0, 1)]
        return np.concatenate([v.ravel(), np.ravel(p_dot), v_dot.ravel(), w_dot.ravel()])

    unit = [1.0, 0.0, 0.0, 0.0]
    return Trajectory(rhs, np.concatenate([*R0, unit, unit, np.zeros(12)]), rtol, atol)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    y = quaternions().at(t)
    r, p, v, w = unpack(y)
    A = np.array([rotation(x) for x in p])
    v_dot, w_dot = accelerations(r, A, v, w)
    potential = loads(r, A, v, w)[2]
    kinetic = sum(
        0.5 * MASS[i] * v[i] @ v[i] + 0.5 * (A[i].T @ w[i]) @ JP[i] @ (A[i].T @ w[i])
        for i in (0, 1)
    )
    out = {
        "v": np.concatenate([v[0], w[0], v[1], w[1]]),
        "v_dot": np.concatenate([v_dot[0], w_dot[0], v_dot[1], w_dot[1]]),
        "energy.kinetic": np.array([kinetic]),
        "energy.potential": np.array([potential]),
        "energy.total": np.array([kinetic + potential]),
    }
    for i, name in enumerate(NAMES):
        out |= {f"r.{name}": r[i], f"p.{name}": p[i], f"rd.{name}": v[i], f"w.{name}": w[i]}
        out |= {f"rdd.{name}": v_dot[i], f"wd.{name}": w_dot[i]}
    return out
