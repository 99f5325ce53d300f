"""Motions of joints about constant axes, from their C and J alone.

N, the null space of J for body i in the axes of that body, holds the twists that a joint leaves
free. Where N is constant, T0 exp(N q) satisfies C = 0: revolute, translational, cylindrical, planar
and spherical joints. Where some twists are constant in body j (S1) and the others in body i (S2),
exp(S1 q1) T0 exp(S2 q2) does: universal joints. Neither is taken for granted: C is evaluated at
random coordinates. All joints of a type are classified at once (docs/decisions/0038).
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.closed_joints import OPEN, ClosedJoints
from dap3d_core.assembly.motion.elementary import elementary
from dap3d_core.assembly.motion.joint_motion import JointMotions, ModelMotions, Part, merged
from dap3d_core.assembly.motion.joint_rows import JointRows
from dap3d_core.assembly.motion.named_axes import NamedAxes
from dap3d_core.assembly.motion.refusals import (
    DEPENDENT,
    NOT_CLOSED,
    NOT_CONSTANT,
    NOT_INVARIANT,
    refused_joints,
    two_bodies,
    two_slots,
)
from dap3d_core.model import Group, Model
from dap3d_core.model.rigid_motion import Pose, adjoint, inverse, relative
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


def classify(model: Model, u: Floats | None = None) -> ModelMotions:
    """The motions of all joints of a model.

    Args:
        model: the model.
        u: (13 n,) the state whose poses are the reference, moved onto C = 0 joint by joint; left
            out, the poses of the scene.

    Raises:
        PluginError: the kernels of a type cannot be compiled.
    """
    mass = np.concatenate([[np.inf], model.mass])
    Jp = np.concatenate([np.zeros((1, 3, 3)), model.Jp])
    r, p, _, _ = split(model.u0 if u is None else u)
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
    group: Group, joints: ClosedJoints, rng: np.random.Generator
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
                members = group.members[fitting.joints]
                motions.append(attrs.evolve(fitting, joints=members))
    reasons = np.full(group.count, NOT_CONSTANT, dtype=object)
    reasons[varies] = NOT_INVARIANT
    reasons[~joints.is_regular] = DEPENDENT
    reasons[~joints.is_closed] = NOT_CLOSED
    known = {k for motion in motions for k in motion.joints.tolist()}
    named = zip(group.members.tolist(), reasons.tolist(), strict=True)
    return motions, {member: reason for member, reason in named if member not in known}


def _one_factor(
    group: Group, joints: ClosedJoints, members: Integers, rng: np.random.Generator
) -> Iterator[JointMotions]:
    """Motions of constant N, to be tried; their joints are places in the group."""
    slots, length = two_slots(group), joints.rows.length
    for part in elementary(joints.free[members]):
        here = members[part.members]
        parts, screws = _aligned(group, joints, here, part.kinds, part.in_metres(length), slots)
        yield _motions(group, joints, here, parts, screws)


def _two_factors(
    group: Group, joints: ClosedJoints, members: Integers, rng: np.random.Generator
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
    Q: Floats = np.linalg.qr(adjoint(scaled) @ free)[0]
    return Q


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
    axes = NamedAxes(group.take(members), start, slots, joints.rows.length)
    return axes.aligned(kinds, screws)


def _motions(
    group: Group,
    joints: ClosedJoints,
    members: Integers,
    parts: tuple[Part, ...],
    screws: Floats,
) -> JointMotions:
    start = Pose(joints.start.r[members], joints.start.p[members])
    i, j = two_bodies(group)[members].T
    return JointMotions(group.keyword, two_slots(group), parts, members, i, j, start, screws)


def _fits(motion: JointMotions, joints: ClosedJoints, rng: np.random.Generator) -> Any:
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


def _random_poses(rng: np.random.Generator, joints: ClosedJoints) -> Pose:
    """A random pose for every body j, within a length of the scene of the origin."""
    r, p = rng.normal(size=(joints.count, 3)), rng.normal(size=(joints.count, 4))
    return Pose(r * joints.rows.length, p / np.linalg.norm(p, axis=-1, keepdims=True))
