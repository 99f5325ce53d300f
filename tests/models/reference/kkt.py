"""A small, dense, generic simulator of constrained rigid bodies, for reference only.
Only the position-level equation C of a constraint is written down (for the driver, its
velocity-level equation). Its Jacobian and the right-hand side gamma of its accelerations come from
exact time derivatives along a motion of constant velocities, so none of the printed formulas for
them is used. The accelerations solve the whole system [M, -D^T; D, 0] (v_dot, lambda) = (g, gamma).
Body -1 is the ground. Velocities are ordered (v, w) a body, in global axes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from rigid import GRAVITY, Array, Trajectory, cross, quaternion_rate, rotation, spring

GROUND = -1


@dataclass(frozen=True)
class Body:
    """A rigid body with its mass centre at its origin, and its state at the start.
    `Jp` is the inertia matrix in the axes of the body, or its diagonal."""

    name: str
    mass: float
    Jp: tuple[float, float, float] | tuple[tuple[float, float, float], ...]
    r: tuple[float, float, float]
    p: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    v: tuple[float, float, float] = (0.0, 0.0, 0.0)
    w: tuple[float, float, float] = (0.0, 0.0, 0.0)


def inertia(body: Body) -> Array:
    """Return the inertia matrix of a body in its axes."""
    Jp = np.array(body.Jp)
    return np.diag(Jp) if Jp.ndim == 1 else Jp


class Fixed(NamedTuple):
    """A point or a direction fixed in a body (or the ground), in its axes."""

    body: int
    local: tuple[float, float, float]


class Jet(NamedTuple):
    """A quantity and its first two time derivatives, for a batch of velocities (last axis)."""

    f0: Array
    f1: Array
    f2: Array

    def __sub__(self, other: "Jet") -> "Jet":
        """Return the difference of two jets."""
        return Jet(self.f0 - other.f0, self.f1 - other.f1, self.f2 - other.f2)


def dot(a: Jet, b: Jet) -> Jet:
    """Return the jet of a scalar product (product rule), as a jet of one row."""

    def inner(x: Array, y: Array) -> Array:
        return (x * y).sum(axis=0, keepdims=True)

    first = inner(a.f1, b.f0) + inner(a.f0, b.f1)
    second = inner(a.f2, b.f0) + 2 * inner(a.f1, b.f1) + inner(a.f0, b.f2)
    return Jet(inner(a.f0, b.f0), first, second)


class Motion:
    """Poses at an instant and a batch of constant velocities, one column each."""

    def __init__(self, r: Array, A: Array, batch: Array) -> None:
        self.r, self.A, self.batch = r, A, batch

    def direction(self, vector: Fixed) -> Jet:
        """Return the jet of a direction."""
        columns = self.batch.shape[1]
        if vector.body == GROUND:
            a = np.repeat(np.array(vector.local)[:, None], columns, axis=1)
            return Jet(a, np.zeros_like(a), np.zeros_like(a))
        w = self.batch[6 * vector.body + 3 : 6 * vector.body + 6]
        a = np.repeat((self.A[vector.body] @ vector.local)[:, None], columns, axis=1)
        a_dot = cross(w, a)
        return Jet(a, a_dot, cross(w, a_dot))

    def point(self, point: Fixed) -> Jet:
        """Return the jet of a point."""
        s = self.direction(point)
        if point.body == GROUND:
            return s
        v = self.batch[6 * point.body : 6 * point.body + 3]
        return Jet(s.f0 + self.r[point.body][:, None], s.f1 + v, s.f2)


class Joint(NamedTuple):
    """Rows of constraints between body i and body j: `C` gives the jets of its rows."""

    name: str
    i: int
    j: int
    C: Callable[[Motion], list[Jet]]


def sph(name: str, P_i: Fixed, P_j: Fixed) -> Joint:
    """Return a spherical joint: the two points coincide."""
    return Joint(name, P_i.body, P_j.body, lambda m: [m.point(P_j) - m.point(P_i)])


def rev(name: str, P_i: Fixed, P_j: Fixed, a_i: Fixed, a_j: Fixed) -> Joint:
    """Return a revolute joint: the points coincide, a_i is normal to two normals of a_j."""
    a = np.array(a_j.local)
    start = np.eye(3)[np.argmin(np.abs(a))]
    n = start - (start @ a) * a
    n /= np.linalg.norm(n)
    n_j, m_j = Fixed(a_j.body, tuple(n)), Fixed(a_j.body, tuple(cross(a, n)))

    def C(m: Motion) -> list[Jet]:
        a_i_now = m.direction(a_i)
        rows = [dot(a_i_now, m.direction(n_j)), dot(a_i_now, m.direction(m_j))]
        return [m.point(P_j) - m.point(P_i), *rows]

    return Joint(name, P_i.body, P_j.body, C)


def distance(name: str, P_i: Fixed, P_j: Fixed, length: float) -> Joint:
    """Return a massless link between two points: (d.d - length^2) / 2 = 0."""

    def C(m: Motion) -> list[Jet]:
        d = m.point(P_j) - m.point(P_i)
        square = dot(d, d)
        return [Jet((square.f0 - length**2) / 2, square.f1 / 2, square.f2 / 2)]

    return Joint(name, P_i.body, P_j.body, C)


class Driver(NamedTuple):
    """A driver at velocity level: a.(w_j - w_i) = rate, body j at rest, a and rate constant."""

    name: str
    i: int
    axis: Fixed
    rate: float


class Spring(NamedTuple):
    """A linear spring, with a damper beside it, between a point on a body and another point."""

    tail: Fixed
    head: Fixed
    k: float
    length: float
    c: float = 0.0


class Moment(NamedTuple):
    """A constant moment on a body, in global axes."""

    body: int
    n: tuple[float, float, float]


@dataclass
class System:
    """Bodies, joints, one optional driver, springs, moments and weight.
    With `redundant` rows the multipliers are those of least norm; the accelerations are unique."""

    bodies: list[Body]
    joints: list[Joint]
    driver: Driver | None = None
    springs: list[Spring] = field(default_factory=list)
    moments: list[Moment] = field(default_factory=list)
    weight: bool = True
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    redundant: bool = False

    @property
    def n(self) -> int:
        """Return the number of bodies."""
        return len(self.bodies)

    def start(self) -> tuple[Array, Array, Array]:
        """Return r, p and the velocities (v, w a body) of the bodies as given."""
        r = np.array([b.r for b in self.bodies], float)
        p = np.array([b.p for b in self.bodies], float)
        return r, p, np.array([[*b.v, *b.w] for b in self.bodies], float).ravel()

    def constraints(self, r: Array, A: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return C (position rows alone), D, nu and gamma."""
        motion = Motion(r, A, np.column_stack([np.eye(6 * self.n), v]))
        jets = [row for joint in self.joints for row in joint.C(motion)]
        C = np.concatenate([jet.f0[:, -1] for jet in jets])
        D = np.concatenate([jet.f1[:, :-1] for jet in jets])
        gamma = -np.concatenate([jet.f2[:, -1] for jet in jets])
        nu = np.zeros(len(gamma))
        if self.driver:
            row, column = np.zeros((1, 6 * self.n)), 6 * self.driver.i + 3
            row[0, column : column + 3] = -np.array(self.driver.axis.local)
            if self.driver.axis.body != GROUND:
                column = 6 * self.driver.axis.body + 3
                row[0, column : column + 3] = self.driver.axis.local
            D, nu = np.concatenate([D, row]), np.append(nu, self.driver.rate)
            gamma = np.append(gamma, 0.0)
        return C, D, nu, gamma

    def row_range(self, name: str) -> slice:
        """Return which rows belong to the joint or driver `name`."""
        r, p, v = self.start()
        motion = Motion(r, np.array([rotation(x) for x in p]), v[:, None])
        start = 0
        for joint in self.joints:
            count = sum(len(row.f0) for row in joint.C(motion))
            if joint.name == name:
                return slice(start, start + count)
            start += count
        return slice(start, start + 1)

    def mass_matrix(self, A: Array) -> Array:
        """Return the mass matrix."""
        M = np.zeros((6 * self.n, 6 * self.n))
        for i, body in enumerate(self.bodies):
            M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = body.mass * np.eye(3)
            M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = A[i] @ inertia(body) @ A[i].T
        return M

    def loads(self, r: Array, A: Array, v: Array) -> tuple[Array, float]:
        """Return g (applied loads less the gyroscopic moments) and the potential energy."""
        g, potential = np.zeros(6 * self.n), 0.0
        for i, body in enumerate(self.bodies):
            w = v[6 * i + 3 : 6 * i + 6]
            J = A[i] @ inertia(body) @ A[i].T
            g[6 * i + 3 : 6 * i + 6] -= cross(w, J @ w)
            if self.weight:
                g[6 * i : 6 * i + 3] -= body.mass * GRAVITY * np.array(self.up)
                potential += body.mass * GRAVITY * (r[i] @ self.up)
        for moment in self.moments:
            g[6 * moment.body + 3 : 6 * moment.body + 6] += moment.n
        motion = Motion(r, A, v[:, None])
        for element in self.springs:
            tail, head = motion.point(element.tail), motion.point(element.head)
            ends = [x[:, 0] for x in (tail.f0, tail.f1, head.f0, head.f1)]
            F, energy = spring(*ends, element.k, element.c, element.length)
            potential += energy
            for end, sign in ((element.tail, 1.0), (element.head, -1.0)):
                if end.body != GROUND:
                    arm = A[end.body] @ end.local
                    g[6 * end.body : 6 * end.body + 3] += sign * F
                    g[6 * end.body + 3 : 6 * end.body + 6] += sign * cross(arm, F)
        return g, potential

    def solve(self, r: Array, A: Array, v: Array) -> tuple[Array, Array]:
        """Return accelerations and multipliers of the whole saddle-point system."""
        _, D, _, gamma = self.constraints(r, A, v)
        g, _ = self.loads(r, A, v)
        m = len(D)
        K = np.block([[self.mass_matrix(A), -D.T], [D, np.zeros((m, m))]])
        right = np.concatenate([g, gamma])
        if self.redundant:
            x = np.linalg.lstsq(K, right, rcond=1e-11)[0]
        else:
            x = np.linalg.solve(K, right)
        return x[: 6 * self.n], x[6 * self.n :]

    def corrected(self) -> tuple[Array, Array, Array]:
        """Return the start with both minimum-norm corrections."""
        r, p, v = self.start()
        for _ in range(25):
            A = np.array([rotation(x) for x in p])
            C, D, nu, _ = self.constraints(r, A, v)
            if np.abs(C).max() <= 1e-10:
                break
            dz = -np.linalg.lstsq(D[: len(C)], C, rcond=1e-10)[0].reshape(self.n, 6)
            r = r + dz[:, :3]
            p = np.array([x + quaternion_rate(x, d[3:]) for x, d in zip(p, dz, strict=True)])
            p /= np.linalg.norm(p, axis=1)[:, None]
        return r, p, v - np.linalg.lstsq(D, D @ v - nu, rcond=1e-10)[0]

    @cached_property
    def counts(self) -> dict[str, Array]:
        """Return rows, rank and degrees of freedom at the corrected start."""
        r, p, v = self.corrected()
        D = self.constraints(r, np.array([rotation(x) for x in p]), v)[1]
        rank = np.linalg.matrix_rank(D, rtol=1e-11)
        return {
            "rows": np.array([len(D)]),
            "rank": np.array([rank]),
            "dof": np.array([6 * self.n - rank]),
        }

    def trajectory(self, rtol: float = 1e-13, atol: float = 1e-15) -> Trajectory:
        """Return the motion of (r, p, r_dot, w in body axes) from the corrected start."""
        r, p, v = self.corrected()

        def rhs(_: float, y: Array) -> Array:
            r, p, v = self.unpack(y)
            A = [rotation(x) for x in p]
            v_dot, _ = self.solve(r, np.array(A), v)
            rate, second = v.reshape(self.n, 6), v_dot.reshape(self.n, 6)
            p_dot = [quaternion_rate(x, w) for x, w in zip(p, rate[:, 3:], strict=True)]
            # the rate of A^T w is A^T w_dot exactly: the extra term is w x w
            wp_dot = [a.T @ x for a, x in zip(A, second[:, 3:], strict=True)]
            parts = (rate[:, :3], p_dot, second[:, :3], wp_dot)
            return np.concatenate([np.ravel(x) for x in parts])

        rate = v.reshape(self.n, 6)
        wp = [rotation(x).T @ w for x, w in zip(p, rate[:, 3:], strict=True)]
        y0 = np.concatenate([np.ravel(x) for x in (r, p, rate[:, :3], wp)])
        return Trajectory(rhs, y0, rtol, atol)

    def simulator(
        self, rtol: float = 1e-13, atol: float = 1e-15
    ) -> Callable[[float], dict[str, Array]]:
        """Return a function of time: all quantities of the motion, which is found once."""

        @cache
        def motion() -> Trajectory:
            return self.trajectory(rtol, atol)

        return lambda t: self.quantities(*self.unpack(motion().at(t)))

    def unpack(self, y: Array) -> tuple[Array, Array, Array]:
        """Return r, p and the velocities (global axes) of a state of `trajectory`."""
        n = self.n
        r, p = y[: 3 * n].reshape(n, 3), y[3 * n : 7 * n].reshape(n, 4)
        r_dot, wp = y[7 * n : 10 * n].reshape(n, 3), y[10 * n :].reshape(n, 3)
        w = [rotation(x) @ y for x, y in zip(p, wp, strict=True)]
        return r, p, np.column_stack([r_dot, w]).ravel()

    def quantities(
        self, r: Array, p: Array, v: Array, v_dot: Array | None = None
    ) -> dict[str, Array]:
        """Return every quantity that `expected.toml` may name.
        With `v_dot` given, the multipliers are those that these accelerations need; they must be
        unique."""
        A = np.array([rotation(x) for x in p])
        M, (g, potential) = self.mass_matrix(A), self.loads(r, A, v)
        D = self.constraints(r, A, v)[1]
        if v_dot is None:
            v_dot, lam = self.solve(r, A, v)
        else:
            lam = np.linalg.lstsq(D.T, M @ v_dot - g, rcond=None)[0]
        out = {
            "v": v,
            "v_dot": v_dot,
            "energy.kinetic": np.array([v @ M @ v / 2]),
            "energy.potential": np.array([potential]),
            "energy.total": np.array([v @ M @ v / 2 + potential]),
        }
        for i, body in enumerate(self.bodies):
            rate, acceleration = v[6 * i : 6 * i + 6], v_dot[6 * i : 6 * i + 6]
            out |= {f"r.{body.name}": r[i], f"p.{body.name}": p[i]}
            out |= {f"rd.{body.name}": rate[:3], f"rdd.{body.name}": acceleration[:3]}
            out |= {f"w.{body.name}": rate[3:], f"wd.{body.name}": acceleration[3:]}
            out[f"wp.{body.name}"] = A[i].T @ rate[3:]
            out[f"wpd.{body.name}"] = A[i].T @ acceleration[3:]
        ends = [(joint.name, joint.i, joint.j) for joint in self.joints]
        if self.driver:
            ends.append((self.driver.name, self.driver.i, self.driver.axis.body))
        for name, i, j in ends:
            rows = self.row_range(name)
            out[f"lambda.{name}"] = lam[rows]
            for side, body in (("i", i), ("j", j)):
                if body != GROUND:
                    wrench = D[rows, 6 * body : 6 * body + 6].T @ lam[rows]
                    out[f"reaction.{name}.{side}.force"] = wrench[:3]
                    out[f"reaction.{name}.{side}.moment"] = wrench[3:]
        return out
