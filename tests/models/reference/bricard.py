"""Reference for the model `A04`, Bricard's mechanism: two angles and one equation between them.

The six vertices are those of a cube but for two opposite ones. The mechanism keeps the threefold
symmetry about the line of these two: the first, third and fifth joint turn by -a, the second,
fourth and sixth by b, and the loop closes where

    f(a, b) = sin(b) - sin(a) - sin(a) sin(b) = 0

Virtual power along f = 0 gives the accelerations.
One of the 30 rows is redundant, so some reactions are open. `simulated` integrates the whole
mechanism once more in the generic simulator `kkt`, which knows nothing of the symmetry.
"""

from functools import cache

import numpy as np
from kkt import GROUND, Body, Fixed, System, rev
from rigid import GRAVITY, Array, Trajectory, cross, product, rotation, turn

NODES = np.array(
    [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float
)  # fmt: skip
AXES = np.array([(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)], float)
TURNS = np.array([[-1, 0], [0, 1]] * 3, float)  # of each joint, by a and by b
MASS, ALONG, ACROSS = 1.0, 1 / 600, 1.01 / 12
Y = np.array([0.0, 1.0, 0.0])
JP = [np.where(np.diff(NODES, axis=0)[k] != 0, ALONG, ACROSS) for k in range(5)]


def motion(angles: Array, speeds: Array, turning: Array) -> tuple[Array, ...]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the five rods.
    `angles`, `speeds` and `turning` are a, b and their derivatives."""
    by_joint = [TURNS @ x for x in (angles, speeds, turning)]
    tip, tip_dot, tip_ddot, w, w_dot = (np.zeros(3) for _ in range(5))
    p, parts = np.array([1.0, 0.0, 0.0, 0.0]), []
    for k in range(5):
        e = rotation(p) @ AXES[k]
        w_dot = w_dot + e * by_joint[2][k] + cross(w, e) * by_joint[1][k]
        w = w + e * by_joint[1][k]
        p = product(p, turn(AXES[k], by_joint[0][k]))
        rod = rotation(p) @ (NODES[k + 1] - NODES[k])
        rod_dot = cross(w, rod)
        rod_ddot = cross(w_dot, rod) + cross(w, rod_dot)
        rates = np.concatenate([tip_dot + rod_dot / 2, w])
        parts.append((tip + rod / 2, p, rates, np.concatenate([tip_ddot + rod_ddot / 2, w_dot])))
        tip, tip_dot, tip_ddot = tip + rod, tip_dot + rod_dot, tip_ddot + rod_ddot
    r, poses, v, v_dot = (np.array(x) for x in zip(*parts, strict=True))
    return r, poses, v, v_dot


def second(angles: Array, speeds: Array) -> Array:
    """Return the second derivatives of a and b."""
    (sa, sb), (ca, cb) = np.sin(angles), np.cos(angles)
    slope = np.array([-ca * (1 + sb), cb * (1 - sa)])
    bend = np.array([[sa * (1 + sb), -ca * cb], [-ca * cb, -sb * (1 - sa)]])
    base = -slope * (speeds @ bend @ speeds) / (slope @ slope)
    way = np.array([slope[1], -slope[0]])
    along = motion(angles, way, np.zeros(2))[2]
    _, p, v, rest = motion(angles, speeds, base)
    inertia, power = 0.0, 0.0
    for k in range(5):
        A = rotation(p[k])
        J = A @ np.diag(JP[k]) @ A.T
        u, x, w = along[k], rest[k], v[k, 3:]
        inertia += MASS * u[:3] @ u[:3] + u[3:] @ J @ u[3:]
        power -= MASS * u[:3] @ (x[:3] + GRAVITY * Y)
        power -= u[3:] @ (J @ x[3:] + cross(w, J @ w))
    return base + power / inertia * way


@cache
def trajectory() -> Trajectory:
    """Return the motion of (a, b) and their rates."""
    return Trajectory(lambda _, y: np.concatenate([y[2:], second(y[:2], y[2:])]), np.zeros(4))


def system() -> System:
    """Return the mechanism in space, at the start."""
    centres = (NODES[1:] + NODES[:-1]) / 2
    bodies = [Body(f"rod{k + 1}", MASS, tuple(map(float, JP[k])), tuple(map(float, centres[k])))
              for k in range(5)]  # fmt: skip

    def on(body: int, node: int) -> Fixed:
        return Fixed(body, tuple(map(float, NODES[node] - centres[body])))

    joints = []
    for k in range(6):
        axis = tuple(map(float, AXES[k]))
        i, j = (k, k - 1) if k < 5 else (4, GROUND)  # ground is GROUND = -1 for the first as well
        P_j = on(j, k) if j != GROUND else Fixed(GROUND, tuple(map(float, NODES[k])))
        joints.append(rev(f"J{k + 1}", on(i, k), P_j, Fixed(i, axis), Fixed(j, axis)))
    return System(bodies, joints, up=tuple(Y), redundant=True)


SYSTEM = system()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    y = trajectory().at(t)
    r, p, v, v_dot = motion(y[:2], y[2:], second(y[:2], y[2:]))
    out = SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())
    end = rotation(p[1]) @ (NODES[2] - NODES[1]) / 2  # rod 2 reaches from node 1 to P3
    out |= {"rP.P3": r[1] + end, "rPd.P3": v[1, :3] + cross(v[1, 3:], end)}
    return out


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator(1e-12, 1e-13)
