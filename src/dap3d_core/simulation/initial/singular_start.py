"""Starts at singular poses: the motions that lead away from there, and which one a run takes.

Where constraints lose rank, D v_dot = gamma leaves more accelerations open than there are motions.
With lambda^T D = 0, two derivatives of C more than the rows show say which of them go on:

    lambda^T gamma(v) = 0           velocities v: the tangents of the branches (second order)
    d/dt lambda^T (D v_dot - gamma) = 0     accelerations on the branch of v (third order)

From rest the second-order condition holds for accelerations, and Gauss's principle of least
constraint chooses: of the accelerations that some branch allows, the one nearest to that without
joints, measured by the masses. Sources: Wohlhart, Degrees of shakiness, Mech. Mach. Theory 34,
1999 (tangent cones of linkages); Gauss, Über ein neues allgemeines Grundgesetz der Mechanik, 1829.

Coordinates are the bodies' scaled ones (linear/ldlt/factor.py), in which the masses are one.
"""

from collections.abc import Iterator

import attrs
import numpy as np

from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank import DENSE_ROWS, Rank
from dap3d_core.model.state_layout import at_rest, split, velocities_of
from dap3d_core.registry.suggestions import some
from dap3d_core.simulation.initial.assemble import max_speed
from dap3d_core.simulation.initial.least_change import (
    displaced,
    finite_rows,
    least_change,
    mass_scaling,
    quadratic_part,
    unscaled,
)

#: A condition of second order counts as fulfilled below this part of the largest gamma.
FULFILLED = 1e-6
#: Dimensions of the null space beyond which branches are not looked for: their number grows with
#: the square of it.
MOST_FREE = 60
#: Velocities (of 1 m and 1 rad) from which the tangent cone is searched, passes of each, branches
#: that are kept.
SEARCHES, PASSES, MOST_BRANCHES = 60, 40, 8
#: Branches whose projectors differ by less are one; two constraints that differ by less are equal.
SAME, TIED = 1e-6, 1e-6
#: An acceleration below this part of what is free is none; velocities whose square is below this
#: part of the acceleration choose a branch, and no more.
ZERO_ACCELERATION, SLOW = 1e-9, 1e-9
#: How far a motion goes, in rad or parts of the model: to the pose whose pivots are watched in
#: place of those of the start, and in the first step.
OFFSET_ANGLE, FIRST = 0.1, 0.05
#: Span of the differences in time of the third-order condition, as a part of a radian.
SPAN = 1e-3
#: Weights of a derivative at the first of five points, times twelve.
FORWARD = (-25.0, 48.0, -36.0, 16.0, -3.0)
#: Instants, s, at which functions of time may show.
LATER = (1e-3, 0.1, 1.0)


@attrs.frozen(eq=False)
class SingularStart:
    """A start at a pose where constraints lose rank.

    Attributes:
        branches: a line for each motion that leads from there, with velocities along it.
        acceleration: (6 n,) r_ddot, omega_dot of each body on the branch that the run takes; empty
            where none can be determined.
        aside: (13 n,) a state close to that branch, off the singular pose.
        first_step: length of a step that leads away from it, s.
        words: which branch that is, or why there is none, with what to do; a sentence without its
            full stop.
    """

    branches: tuple[str, ...]
    acceleration: Floats
    aside: Floats
    first_step: float
    words: str

    @property
    def leads_on(self) -> bool:
        """True if the branch on which the motion continues is determined."""
        return len(self.acceleration) > 0

    def describe(self) -> str:
        """The sentence, and the branches."""
        listed = "".join(f"\n  ({k}) {words}" for k, words in enumerate(self.branches, start=1))
        return f"the run starts at a singular pose; {self.words}{':' if listed else ''}{listed}"


def singular_start(evaluator: Evaluator, u: Floats, rank: Rank, t: float) -> SingularStart | None:
    """Description of a singular start u (13 n,); None if its pose is not singular.

    rank: of its constraints; some of them are redundant.
    """
    if not _loses_rank(evaluator, u, rank, t):
        return None
    if evaluator.model.row_count > DENSE_ROWS or rank.dof > MOST_FREE:
        return _refused([], "the scene is too large for its branches to be found")
    cone = _Cone(evaluator, u, rank, t)
    if np.any(velocities_of(cone.u)):
        return _moving(cone)
    return _at_rest(cone)


def _loses_rank(evaluator: Evaluator, u: Floats, rank: Rank, t: float) -> bool:
    """True if redundant rows forbid, at second order, velocities that all rows allow."""
    n = evaluator.model.body_count
    still = at_rest(u)
    rows = finite_rows(evaluator, t, still)
    if not np.bincount(rows.row, rows.value**2, minlength=rows.shape[0]).all():
        return False  # a row without a gradient is named where the run stops
    wish = np.random.default_rng(0).standard_normal(6 * n)
    free = wish - least_change(evaluator, rows, rows.product(wish), t)
    if np.linalg.norm(free) <= ZERO_ACCELERATION * np.linalg.norm(wish):
        return False
    gradient = scaled_rows(rows, evaluator.model.length)[1]  # dependencies are those of scaled rows
    quadratic = quadratic_part(evaluator, still, free, t) / gradient
    gaps = [d.combinations @ quadratic[d.rows] for d in rank.dependencies]
    worst = max(float(np.max(np.abs(gap))) for gap in gaps)
    scaled = attrs.evolve(rows, value=rows.value / gradient[rows.row])
    return worst > FULFILLED * _size(evaluator, scaled, free)


def _size(evaluator: Evaluator, rows: ConstraintRows, v: Floats) -> float:
    """Natural size of gamma at velocities v (6 n,)."""
    flow = np.abs(rows.value * v[rows.column])
    return float(np.max(np.bincount(rows.row, flow))) * max_speed(evaluator, v)


class _Cone:
    """Velocities that a singular pose allows: to first order a space, to second order a cone.

    Attributes:
        N: (6 n, f) velocities that all rows allow, an orthonormal basis in the metric of masses.
        left: (k, rows) combinations of rows that vanish.
        H: (k, f, f) the cone is z^T H z = 0.
        size: natural size of z^T H z.
        free: (6 n,) accelerations that the rows alone allow.
        z: (f,) the part in N of the accelerations without joints.
        load: size of these accelerations.
    """

    def __init__(self, evaluator: Evaluator, u: Floats, rank: Rank, t: float) -> None:
        self.evaluator, self.u, self.t = evaluator, u, t
        n = evaluator.model.body_count
        self.still = at_rest(u)
        rows = finite_rows(evaluator, t, u)
        scale, frame = self._scaling = mass_scaling(evaluator)
        block = rows.dense().reshape(-1, n, 6)
        block[:, :, :3] *= scale
        block[:, :, 3:] = np.einsum("mbr,brc->mbc", block[:, :, 3:], frame)
        D = block.reshape(len(block), -1)
        left, values, right = np.linalg.svd(D)
        self.rows, self.left = rows, left[:, rank.rank :].T
        held, self._loose = right[: rank.rank], right[rank.rank :]
        self.N = self._unscaled(self._loose.T)
        free = self._without_joints()
        self.z = self._loose @ free
        needed = left[:, : rank.rank].T @ (rows.gamma - D @ free)
        self.free = self._unscaled(free + held.T @ (needed / values[: rank.rank]))
        self.load = float(np.linalg.norm(free))
        f = self.N.shape[1]
        self.H = np.zeros((len(self.left), f, f))
        self.size = max(_size(evaluator, rows, v) for v in self.N.T)
        for i in range(f):
            for j in range(i + 1):
                plus, minus = (
                    quadratic_part(evaluator, self.still, self.N[:, i] + sign * self.N[:, j], t)
                    for sign in (1.0, -1.0)
                )
                self.H[:, i, j] = self.H[:, j, i] = self.left @ (plus - minus) / 4.0

    def _unscaled(self, x: Floats) -> Floats:
        """From scaled coordinates (6 n, ...) to metres and rad in global axes."""
        columns = x.reshape(len(x), -1).T
        done = [unscaled(c.reshape(-1, 6), *self._scaling).ravel() for c in columns]
        return np.array(done).T.reshape(x.shape)

    def _without_joints(self) -> Floats:
        """Scaled accelerations (6 n,) that the bodies would have without joints."""
        force = self.evaluator.applied_forces(self.t, self.u)
        scale, frame = self._scaling
        w = split(self.u)[3]
        inertia = np.linalg.inv(frame @ frame.transpose(0, 2, 1))
        moment = force[:, 3:] - np.cross(w, np.einsum("brc,bc->br", inertia, w))
        return np.hstack([scale * force[:, :3], np.einsum("brc,br->bc", frame, moment)]).ravel()

    def tangents(self, across: Floats) -> Floats | None:
        """(f, b) what rows (k, f) leave, orthonormal; None where that is no branch."""
        _, values, right = np.linalg.svd(across)
        rank = int(np.sum(values > FULFILLED * max(values[0], 1e-300))) if np.any(across) else 0
        T: Floats = right[rank:].T
        within = np.einsum("ia,kij,jb->kab", T, self.H, T)
        if T.shape[1] and np.max(np.abs(within)) > FULFILLED * self.size:
            return None
        return T

    def branches(self) -> list[Floats]:
        """(f, b) tangent spaces of the branches that were found, orthonormal, each once."""
        found: list[Floats] = []
        for z in self._directions():
            T = self.tangents(np.einsum("kij,j->ki", self.H, z))
            if T is None or not T.shape[1]:
                continue
            P = T @ T.T
            if all(np.linalg.norm(P - other @ other.T) > SAME for other in found):
                found.append(T)
            if len(found) == MOST_BRANCHES:
                break
        return found

    def _directions(self) -> Iterator[Floats]:
        """Directions (f,) on the cone, by Newton's method: from what is free, and at random."""
        rng = np.random.default_rng(1)
        for k in range(SEARCHES):
            z = self.z if k == 0 else rng.standard_normal(len(self.z))
            for _ in range(PASSES):
                if not np.any(z):
                    break
                z = z / np.linalg.norm(z)
                gap = np.einsum("i,kij,j->k", z, self.H, z)
                if np.max(np.abs(gap)) <= 1e-3 * FULFILLED * self.size:
                    yield z
                    break
                slope = 2.0 * np.einsum("kij,j->ki", self.H, z)
                z = z - np.linalg.lstsq(slope, gap, rcond=FULFILLED)[0]

    def words(self, branches: list[Floats]) -> list[str]:
        """A line for each branch: velocities along it that the others do not have."""
        if not branches:  # a driver whose motion none of them has
            return []
        f = len(self.z)
        outside = [np.eye(f) - T @ T.T for T in branches]
        _, values, right = np.linalg.svd(np.vstack(outside))
        common = right[values <= SAME].T
        lines = []
        for T in branches:
            own = T - common @ (common.T @ T)
            left = np.linalg.svd(own)[0]
            lines.append(self._line(self.N @ left[:, 0]))
        return lines

    def _line(self, v: Floats) -> str:
        """Velocities as a scene gives them, the largest component one."""
        names = self.evaluator.model.body_names
        v = v / v[np.argmax(np.abs(v))]
        moving = [
            f"{name} r_dot = {_vector(x[:3])}, w = {_vector(x[3:])}"
            for name, x in zip(names, v.reshape(-1, 6), strict=True)
            if np.max(np.abs(x)) > SAME
        ]
        return some(moving, between="; ")

    def taken(self, T: Floats, z: Floats, way: Floats, words: str) -> SingularStart:
        """The start that takes a branch (f, b), with accelerations ``free`` + N z.

        way: (6 n,) velocities, or accelerations, along it.
        """
        v = velocities_of(self.u)
        aside = displaced(self.still, OFFSET_ANGLE / max_speed(self.evaluator, way) * way)
        acceleration = self.free + self.N @ z
        speed, rise = max_speed(self.evaluator, v), max_speed(self.evaluator, acceleration)
        first_step = 2.0 * FIRST / (speed + (speed * speed + 2.0 * rise * FIRST) ** 0.5)
        lines = self.words(self._with(T))
        return SingularStart(tuple(lines), acceleration, aside, first_step, words)

    def _with(self, T: Floats) -> list[Floats]:
        """All branches, this one first."""
        P = T @ T.T
        return [T, *(b for b in self.branches() if np.linalg.norm(P - b @ b.T) > SAME)]


def _vector(x: Floats) -> str:
    return "[" + ", ".join(f"{c + 0.0:.6g}" for c in np.where(np.abs(x) > SAME, x, 0.0)) + "]"


def _refused(lines: list[str], why: str) -> SingularStart:
    remedy = "give velocities along one of its branches, or a pose off the singular one"
    return SingularStart(tuple(lines), np.zeros(0), np.zeros(0), 0.0, f"{why}; {remedy}")


def _moving(cone: _Cone) -> SingularStart:
    """The branch that the velocities are on, and the accelerations there."""
    v, gap = velocities_of(cone.u), cone.left @ cone.rows.gamma
    size = _size(cone.evaluator, cone.rows, v)
    if np.max(np.abs(gap)) > FULFILLED * size:
        lines = cone.words(cone.branches())
        return _refused(lines, "its velocities are along none of the motions that lead from there")
    half = [_gamma(cone, v + z) - _gamma(cone, v - z) for z in cone.N.T]
    across = -0.75 * cone.left @ np.column_stack(half)
    T = cone.tangents(across) if np.max(np.abs(across)) > FULFILLED * size else None
    if T is None:
        return _refused([], "its velocities are along more than one of the motions from there")
    z = T @ (T.T @ cone.z) - cone.z
    slow = max_speed(cone.evaluator, v) ** 2 <= SLOW * max_speed(cone.evaluator, cone.free)
    for _ in range(0 if slow else 2):  # again on the branch, where less is neglected
        z += np.linalg.lstsq(across, -_third(cone, v, cone.free + cone.N @ z), rcond=FULFILLED)[0]
    return cone.taken(T, z, v, "it goes on as the velocities do, on branch (1)")


def _gamma(cone: _Cone, v: Floats) -> Floats:
    state = cone.still.copy()
    velocities_of(state)[:] = v
    return finite_rows(cone.evaluator, cone.t, state).gamma


def _third(cone: _Cone, v: Floats, a: Floats) -> Floats:
    """d/dt of lambda^T (D a - gamma) (k,) along a motion with velocities v, accelerations a."""
    h = SPAN / max(max_speed(cone.evaluator, v), max_speed(cone.evaluator, a) ** 0.5)
    total = np.zeros(len(cone.left))
    for k, weight in enumerate(FORWARD):
        s = k * h
        state = displaced(cone.still, s * v + 0.5 * s * s * a)
        velocities_of(state)[:] = v + s * a
        rows = finite_rows(cone.evaluator, cone.t + s, state)
        total += weight * cone.left @ (rows.product(a) - rows.gamma)
    return total / (12.0 * h)


def _at_rest(cone: _Cone) -> SingularStart | None:
    """The branch of least constraint, with the accelerations there."""
    found = cone.branches()
    lines = cone.words(found) if found else []
    if _is_driven(cone):
        return _refused(lines, "from rest there, what drivers do does not say which way they go on")
    if np.linalg.norm(cone.z) <= ZERO_ACCELERATION * cone.load:
        return None
    kept = [float(np.linalg.norm(T.T @ cone.z)) for T in found]
    order = np.argsort(kept)[::-1]
    if not found:
        return _refused([], "no motion leads from there, though forces act along one that the "
                        "joints allow at first")  # fmt: skip
    best = int(order[0])
    if len(found) > 1 and kept[order[1]] > (1.0 - TIED) * kept[best]:
        return _refused(lines, "the bodies are at rest, and two branches resist the forces equally")
    z = found[best] @ (found[best].T @ cone.z)
    words = (
        "the bodies are at rest, and the forces take them along branch (1), which resists them "
        "least (Gauss); for another give velocities along it"
    )
    return cone.taken(found[best], z - cone.z, cone.N @ z, words)


def _is_driven(cone: _Cone) -> bool:
    """True if functions of time move constraints."""
    before = finite_rows(cone.evaluator, cone.t, cone.still)
    if np.any(before.nu) or np.any(before.gamma):
        return True
    later = (finite_rows(cone.evaluator, cone.t + after, cone.still) for after in LATER)
    return any(not np.array_equal(rows.C, before.C) or np.any(rows.nu) for rows in later)
