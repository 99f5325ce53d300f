"""Motions of joints about constant axes, from their C and J alone.

N, the null space of J for body i in the axes of that body, holds the twists that a joint leaves
free. Where N is constant, T0 exp(N q) satisfies C = 0: revolute, translational, cylindrical, planar
and spherical joints. Where some twists are constant in body j (S1) and the others in body i (S2),
exp(S1 q1) T0 exp(S2 q2) does: universal joints. Neither is taken for granted: C is evaluated at
random coordinates. All joints of a type are classified at once (docs/decisions/0038).
"""

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.joint_motion import (
    BALL,
    ROTATION,
    SCREW,
    TRANSLATION,
    JointMotions,
    ModelMotions,
    NamedAxes,
    Part,
    merged,
)
from dap3d_core.assembly.motion.joint_rows import (
    DEPENDENT,
    NOT_CLOSED,
    NOT_CONSTANT,
    NOT_INVARIANT,
    JointRows,
    refused_joints,
    two_bodies,
    two_slots,
)
from dap3d_core.model import Group, Model
from dap3d_core.model.rigid_motion import Pose, adjoint, compose, exponential, inverse, relative
from dap3d_core.model.state_layout import split

#: Eigenvalues of the sum of two projectors: a twist lies in both spaces, or clearly not.
COMMON, APART = 1e-9, 1e-5
#: Singular value of unit twists below which one is a combination of others.
DISTINCT = 1e-6
#: Length of the way, in rad and lengths of the scene, to a second pose of a joint.
AWAY = 1.5
#: Random coordinates that a motion is tried at.
TRIALS = 2
#: Seeds of random numbers, one for each attempt: a way may end where both spaces nearly agree.
SEEDS = 1, 2, 3
#: Singular values and pitches, in units of the scene's length, that count as zero.
ZERO = 1e-9
#: Residuals of a closed joint, and of one that cannot be told from it; see ``residual``.
CLOSED, OPEN = 1e-13, 1e-10
NEWTON_STEPS = 20
#: Added to J J^T of gradients of length one, which may depend on each other.
REGULAR = 1e-13
#: Singular values of gradients of length one below which rows depend on each other.
SINGULAR = 1e-6


class ClosedJoints:
    """Joints in poses with C = 0, near the ones given, and their free twists there.

    Attributes:
        rows: evaluates C and J.
        count: number of joints.
        unit: (6,) units of the numbers of a twist: the scene's length and 1.
        start: T0, poses of bodies i relative to bodies j.
        is_closed, is_regular: (m,) whether C = 0 was reached, and the rows are independent there.
        free: (m, 6, d) orthonormal columns, the null space of J, in ``unit``.
    """

    def __init__(self, rows: JointRows, pose: Pose) -> None:
        """Args:
        rows: of the joints.
        pose: of bodies i relative to bodies j, as given.
        """
        self.rows, self.count = rows, rows.count
        self.unit = np.repeat([rows.length, 1.0], 3)
        rows.place(pose)
        rows.count_turns()
        self._weight = _weights(rows.gradients())
        self.start, self.is_closed = self.closed(pose)
        rows.place(self.start)
        rows.count_turns()
        self._weight = _weights(rows.gradients())
        self.free, self.is_regular = self.free_twists(self.start)

    def residual(self, pose: Pose, base: Pose | None = None) -> Floats:
        """(m,) the largest of C at other poses: a displacement, relative to the scene and the pose.

        Rounding alone leaves some 1e-16; infinite where C is not a number. ``base``: of bodies j.
        """
        self.rows.place(pose, base)
        C = np.abs(self.rows.residuals() * self._weight)
        reach = 1.0 + np.max(np.abs(pose.r), axis=-1) / self.rows.length
        worst: Floats = np.max(C, axis=-1, initial=0.0) / reach
        return np.where(np.isfinite(worst), worst, np.inf)

    def closed(self, pose: Pose) -> tuple[Pose, Any]:
        """Poses with C = 0 near those given, by Newton's method, and whether they were found."""
        worst = self.residual(pose)
        for _ in range(NEWTON_STEPS):
            if not np.any(worst >= CLOSED):
                break
            C, J = self.rows.residuals() * self._weight, self._gradients()
            moves: Any = np.isfinite(J).all(axis=(1, 2)) & np.isfinite(C).all(axis=1)
            step = _shortest_steps(J, C, np.flatnonzero(moves & (worst >= CLOSED)))
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            pose = self.moved(pose, step / np.maximum(1.0, size))
            worst = self.residual(pose)
        return pose, worst < OPEN

    def free_twists(self, pose: Pose) -> tuple[Floats, Any]:
        """The null spaces (m, 6, d) of J at poses, and whether the rows are independent there."""
        self.rows.place(pose)
        J = self._gradients()
        finite: Any = np.isfinite(J).all(axis=(1, 2))
        _, size, directions = np.linalg.svd(np.where(finite[:, None, None], J, 0.0))
        rows = self.rows.row_count
        regular = finite & (size[:, -1] > SINGULAR) if rows <= 6 else np.zeros_like(finite)
        return np.swapaxes(directions[:, rows:], -1, -2), regular

    def moved(self, pose: Pose, twist: Floats) -> Pose:
        """Poses moved by twists (m, 6) in ``unit``."""
        return compose(pose, exponential(twist * self.unit))

    def _gradients(self) -> Floats:
        return self.rows.gradients() * self._weight[..., None]


def _shortest_steps(J: Floats, C: Floats, members: Integers) -> Floats:
    """(m, 6) the steps of Newton's method for some of the joints; zero for the others."""
    step, J, C = np.zeros((len(J), 6)), J[members], C[members, :, None]
    J_T = np.swapaxes(J, -1, -2)
    multipliers = np.linalg.solve(J @ J_T + REGULAR * np.eye(J.shape[1]), C)
    step[members] = -(J_T @ multipliers)[..., 0]
    return step


def _weights(gradients: Floats) -> Floats:
    """(m, rows) inverse lengths of gradients; 1 where there is none."""
    size = np.linalg.norm(gradients, axis=-1)
    return 1.0 / np.where(np.isfinite(size) & (size > 0.0), size, 1.0)


def classify(model: Model, u: Floats | None = None) -> ModelMotions:
    """The motions of all joints of a model.

    Args:
        model: the model.
        u: (13 n,) the state whose poses are the reference, moved onto C = 0 joint by joint; left
            out, the reference poses of the scene.

    Raises:
        PluginError: the kernels of a type cannot be compiled.
    """
    mass = np.concatenate([[np.inf], model.mass])
    Jp = np.concatenate([np.zeros((1, 3, 3)), model.Jp])
    r, p = (model.r_0, model.p_0) if u is None else split(u)[:2]
    r = np.concatenate([np.zeros((1, 3)), r])
    p = np.concatenate([[[1.0, 0.0, 0.0, 0.0]], p])
    motions: list[JointMotions] = []
    refused: dict[int, str] = {}
    for group in model.joints:
        reasons = refused_joints(group)
        refused |= reasons
        group = group.take(np.flatnonzero([k not in reasons for k in group.members.tolist()]))
        if group.count:
            i, j = two_bodies(group).T
            pose = relative(Pose(r[j], p[j]), Pose(r[i], p[i]))
            found, reasons = classify_group(group, mass, Jp, pose, model.part_size)
            motions += found
            refused |= reasons
    return ModelMotions(merged(motions), dict(sorted(refused.items())))


def classify_group(
    group: Group, mass: Floats, Jp: Floats, pose: Pose, length: float = 1.0
) -> tuple[list[JointMotions], dict[int, str]]:
    """The motions of joints of one type, and reasons for those that have none.

    Args:
        group: joints that ``refused_joints`` leaves.
        mass, Jp: (n + 1,) kg and (n + 1, 3, 3) kg m^2, of the bodies and, first, of ground.
        pose: of bodies i relative to bodies j, as given.
        length: m, of the scene.
    """
    motions: list[JointMotions] = []
    refused: dict[int, str] = {}
    for seed in SEEDS:
        joints = ClosedJoints(JointRows(group, mass, Jp, length), pose)
        found, reasons = _attempt(group, joints, np.random.default_rng(seed))
        motions += found
        refused |= reasons
        again = np.flatnonzero([reasons.get(k) == NOT_CONSTANT for k in group.members.tolist()])
        if not again.size or joints.free.shape[-1] < 2:
            break
        group, pose = group.take(again), Pose(pose.r[again], pose.p[again])
    known = {k for motion in motions for k in motion.joints.tolist()}
    return motions, {k: reason for k, reason in refused.items() if k not in known}


def _attempt(
    group: Group, joints: ClosedJoints, rng: "np.random.Generator"
) -> tuple[list[JointMotions], dict[int, str]]:
    """The motions found on one way, and reasons for joints that have none."""
    varies = joints.residual(joints.start, _random_poses(rng, joints)) > OPEN
    usable = joints.is_closed & joints.is_regular & ~varies
    motions: list[JointMotions] = []
    for search in (_one_factor, _two_factors):
        for candidate in search(group, joints, np.flatnonzero(usable), rng):
            fitting = candidate.take(np.flatnonzero(_fits(candidate, joints, rng)))
            if fitting.joints.size:
                usable[fitting.joints] = False
                motions.append(attrs.evolve(fitting, joints=group.members[fitting.joints]))
    reasons = np.full(group.count, NOT_CONSTANT, dtype=object)
    reasons[varies] = NOT_INVARIANT
    reasons[~joints.is_regular] = DEPENDENT
    reasons[~joints.is_closed] = NOT_CLOSED
    known = {k for motion in motions for k in motion.joints.tolist()}
    named = zip(group.members.tolist(), reasons.tolist(), strict=True)
    return motions, {member: reason for member, reason in named if member not in known}


def _one_factor(
    group: Group, joints: ClosedJoints, members: Integers, rng: "np.random.Generator"
) -> Iterator[JointMotions]:
    """Motions of constant N, to be tried; their joints are places in the group."""
    slots, length = two_slots(group), joints.rows.length
    for part in elementary(joints.free[members]):
        here = members[part.members]
        parts, screws = _aligned(group, joints, here, part.kinds, part.in_metres(length), slots)
        yield _motions(group, joints, here, parts, screws)


def _two_factors(
    group: Group, joints: ClosedJoints, members: Integers, rng: "np.random.Generator"
) -> Iterator[JointMotions]:
    """Motions whose twists are constant in body j or in body i, to be tried."""
    d = joints.free.shape[-1]
    if not members.size or d < 2:
        return
    way = np.einsum("mab,mb->ma", joints.free, rng.normal(size=(joints.count, d)))
    way *= AWAY / np.linalg.norm(way, axis=-1, keepdims=True)
    away, is_closed = joints.closed(joints.moved(joints.start, way))
    free, is_regular = joints.free_twists(away)
    members = members[(is_closed & is_regular)[members]]
    in_i, size_i = _common(joints.free[members], free[members])
    outer = (_seen_from_j(joints, joints.start, joints.free), _seen_from_j(joints, away, free))
    in_j, size_j = _common(*(N[members] for N in outer))
    slots, length = two_slots(group), joints.rows.length
    back = adjoint(inverse(joints.start))
    for size in range(1, d):
        here = np.flatnonzero((size_i == size) & (size_j == d - size))
        for one, other in product(
            elementary(in_j[here, :, : d - size]), elementary(in_i[here, :, :size])
        ):
            _, k, n = np.intersect1d(one.members, other.members, return_indices=True)
            if not k.size:
                continue
            both = members[here[one.members[k]]]
            turned = np.einsum("mab,mdb->mda", back[both], one.in_metres(length)[k])
            first = _aligned(group, joints, both, one.kinds, turned, slots[1:])
            last = _aligned(group, joints, both, other.kinds, other.in_metres(length)[n], slots[:1])
            screws = np.concatenate([first[1], last[1]], axis=1)
            yield _motions(group, joints, both, (*first[0], *last[0]), screws)


def _common(one: Floats, other: Floats) -> tuple[Floats, Integers]:
    """Orthonormal columns (m, 6, 6) of which the first span what two spaces share; how many.

    -1 where that is unclear: the spaces nearly agree, and what they share would be inaccurate.
    """
    outside = sum(np.eye(6) - N @ np.swapaxes(N, -1, -2) for N in (one, other))
    values, columns = np.linalg.eigh(outside)
    unclear = np.any((values > COMMON) & (values < APART), axis=-1)
    return columns, np.where(unclear, -1, np.sum(values < COMMON, axis=-1))


def _seen_from_j(joints: ClosedJoints, pose: Pose, free: Floats) -> Floats:
    """Orthonormal columns of spaces of twists in the axes of body j, at its mass centre."""
    scaled = Pose(pose.r / joints.rows.length, pose.p)
    return np.linalg.qr(adjoint(scaled) @ free)[0]


def _aligned(
    group: Group,
    joints: ClosedJoints,
    members: Integers,
    kinds: tuple[str, ...],
    screws: Floats,
    slots: tuple[str, ...],
) -> tuple[tuple[Part, ...], Floats]:
    """Parts that are constant in the bodies of slots, and their twists, by the type's names."""
    start = Pose(joints.start.r[members], joints.start.p[members])
    return NamedAxes(group.take(members), start, slots, joints.rows.length).aligned(kinds, screws)


def _motions(
    group: Group, joints: ClosedJoints, members: Integers, parts: tuple[Part, ...], screws: Floats
) -> JointMotions:
    start = Pose(joints.start.r[members], joints.start.p[members])
    i, j = two_bodies(group)[members].T
    return JointMotions(group.keyword, two_slots(group), parts, members, i, j, start, screws)


def _fits(motion: JointMotions, joints: ClosedJoints, rng: "np.random.Generator") -> Any:
    """(m,) True where C = 0 at random coordinates, and no part is a combination of others."""
    units = motion.units(joints.rows.length)
    fits = np.ones(len(motion.joints), dtype=bool)
    if motion.size:
        sizes = np.linalg.svd(motion.screws * units[:, None] / joints.unit, compute_uv=False)
        fits = sizes[:, -1] > DISTINCT
    for _ in range(TRIALS):
        moved = motion.pose(units * rng.normal(size=(len(motion.joints), motion.size)))
        pose = Pose(joints.start.r.copy(), joints.start.p.copy())
        pose.r[motion.joints], pose.p[motion.joints] = moved
        fits &= joints.residual(pose, _random_poses(rng, joints))[motion.joints] < OPEN
    return fits


def _random_poses(rng: "np.random.Generator", joints: ClosedJoints) -> Pose:
    """A random pose for every body j, within a length of the scene of the origin."""
    r, p = rng.normal(size=(joints.count, 3)), rng.normal(size=(joints.count, 4))
    return Pose(r * joints.rows.length, p / np.linalg.norm(p, axis=-1, keepdims=True))


class Elementary(NamedTuple):
    """Spaces of twists of one kind.

    Attributes:
        members: (k,) their places among those given.
        kinds: of the elementary motions, translations first.
        screws: (k, d, 6) their unit twists, in units of the scene's length.
    """

    members: Integers
    kinds: tuple[str, ...]
    screws: Floats

    def in_metres(self, length: float) -> Floats:
        """The unit twists in m and 1, of a scene's length in m; those of translations stay."""
        screws = self.screws.copy()
        screws[:, self.kinds.count(TRANSLATION) :, :3] *= length
        return screws


def elementary(spaces: Floats) -> Iterator[Elementary]:
    """Elementary motions that span spaces of twists, each space given by orthonormal columns.

    What has rotations about two axes, or about three and more besides, is left out.

    Args:
        spaces: (m, 6, d) in units of the scene's length.
    """
    m, _, d = spaces.shape
    every = np.arange(m)
    if d == 0:
        yield Elementary(every, (), np.zeros((m, 0, 6)))
        return
    _, size, directions = np.linalg.svd(spaces[:, 3:])
    turning = np.sum(size > ZERO, axis=1)
    # columns in the order of their rotation: those behind ``turning`` are translations
    sorted_ = np.einsum("mab,mcb->mca", spaces, directions)
    for count in (0, 1):
        if (here := np.flatnonzero(turning == count)).size:
            yield from _along_and_about(here, sorted_[here], count)
    if d == 3 and (here := np.flatnonzero(turning == 3)).size:
        yield from _about_a_point(here, spaces[here])


def _along_and_about(members: Integers, twists: Floats, turning: int) -> Iterator[Elementary]:
    """Translations, and with ``turning`` a rotation, which comes first in ``twists`` (k, d, 6)."""
    shifts = twists[:, turning:].copy()
    shifts[..., 3:] = 0.0
    kinds = (TRANSLATION,) * shifts.shape[1]
    if not turning:
        yield Elementary(members, kinds, shifts)
        return
    turn = twists[:, 0] / np.linalg.norm(twists[:, 0, 3:], axis=-1, keepdims=True)
    along = np.einsum("kdc,kc->kd", shifts[..., :3], turn[:, :3])
    v = turn[:, :3] - np.einsum("kdc,kd->kc", shifts[..., :3], along)
    w = turn[:, 3:]
    pitch = np.sum(v * w, axis=-1)
    advances = np.abs(pitch) > ZERO
    v = np.where(advances[:, None], v, v - pitch[:, None] * w)
    screws = np.concatenate([shifts, np.concatenate([v, w], axis=-1)[:, None]], axis=1)
    for kind, here in ((ROTATION, ~advances), (SCREW, advances)):
        if here.any():
            yield Elementary(members[here], (*kinds, kind), screws[here])


def _about_a_point(members: Integers, spaces: Floats) -> Iterator[Elementary]:
    """Rotations about a point c: v = c x w for every twist (v, w)."""
    G = spaces[:, :3] @ np.linalg.inv(spaces[:, 3:])
    is_skew = np.abs(G + np.swapaxes(G, -1, -2)).max(axis=(1, 2)) < ZERO
    members, G = members[is_skew], G[is_skew]
    if members.size:
        screws = np.zeros((len(members), 3, 6))
        screws[..., 3:] = np.eye(3)
        screws[..., :3] = 0.5 * (np.swapaxes(G, -1, -2) - G)  # row k: c x e_k
        yield Elementary(members, (BALL,), screws)
