"""Joint coordinates and their rates, from the motion of bodies.

The pose T of body i relative to body j is T0 exp(s_1 q_1) exp(s_2 q_2) ... (joint_motion.py). Its
angles follow from the rotation, or where two axes are parallel from a point of the second one; its
lengths from the position, in which they are linear; the rates from the relative twist, in which all
are. Paden's subproblems: Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation,
3.3.

The driver measures the angles of joints by constants (assembly/turns.py) that are found here.
"""

from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly import turns as at
from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.joint_motion import (
    BALL,
    ROTATION,
    SCREW,
    TRANSLATION,
    JointMotions,
    ModelMotions,
)
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.model import Model
from dap3d_core.model.joint_angles import JointAngles
from dap3d_core.model.rigid_motion import (
    Pose,
    adjoint,
    compose,
    cross,
    exponential,
    identity,
    inverse,
    relative,
    rotation_vector,
)
from dap3d_core.model.rotations import to_body, to_global

#: Sine of the angle of two axes that are parallel.
PARALLEL = 1e-6
TURN = 2.0 * np.pi


def aliases(motion: JointMotions) -> dict[str, int]:
    """``angle`` and ``length``: the coordinate that is the only one of its sort."""
    is_length = [part.kind == TRANSLATION for part in motion.parts for _ in range(part.size)]
    places = {"angle": np.flatnonzero(~np.array(is_length, dtype=bool)),
              "length": np.flatnonzero(is_length)}  # fmt: skip
    return {name: int(k[0]) for name, k in places.items() if len(k) == 1}


def coordinate_units(motion: JointMotions) -> tuple[str, ...]:
    """Of each coordinate, "rad" or "m"."""
    kinds = (part.kind for part in motion.parts for _ in range(part.size))
    return tuple("m" if kind == TRANSLATION else "rad" for kind in kinds)


def joint_coordinates(
    motion: JointMotions, t: ArrayLike, r: Floats, p: Floats, v: Floats, w: Floats,
    counted: Floats | None = None,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Coordinates q and q_dot of m joints over a motion.

    Turns of angles are those counted in the run. Without these they are counted from the first
    instant, where angles lie in (-pi, pi]; between two instants an angle may change by less than
    half a turn more or less than its rates tell. The rotation vector of a ball is the one of at
    most half a turn.

    Args:
        motion: of the joints.
        t: (nt,) instants, s.
        r, p: (nt, n, 3) in m, (nt, n, 4), of all bodies without ground.
        v, w: (nt, n, 3) velocities in m/s and global angular velocities in rad/s.
        counted: (nt, m, k) angles, rad, within half a turn.

    Returns:
        q (nt, m, d) in rad and m, q_dot (nt, m, d) in rad/s and m/s.
    """
    pose, twist = relative_motion(motion, r, p, v, w)
    q = coordinates(motion, pose)
    q_dot = coordinate_rates(motion, q, twist)
    if counted is None:
        count_turns(motion, np.asarray(t, dtype=float), q, q_dot)
    else:
        angles = angle_columns(motion)
        q[..., angles] += TURN * np.rint((counted - q[..., angles]) / TURN)
    return q, q_dot


def angle_columns(motion: JointMotions) -> list[int]:
    """Indices of the coordinates of a motion that are angles with whole turns."""
    parts = zip(motion.columns, motion.parts, strict=True)
    return [columns.start for columns, part in parts if part.kind in (ROTATION, SCREW)]


def relative_motion(
    motion: JointMotions, r: Floats, p: Floats, v: Floats, w: Floats
) -> tuple[Pose, Floats]:
    """Poses (nt, m) of bodies i relative to bodies j, and twists (nt, m, 6) in axes of bodies i.

    The arguments are those of ``joint_coordinates``.
    """
    i, j = motion.body_i, motion.body_j
    r_i, r_j, v_i, v_j, w_i, w_j = (_of(x, bodies) for x in (r, v, w) for bodies in (i, j))
    p_i, p_j = (_of(p, bodies, (1.0, 0.0, 0.0, 0.0)) for bodies in (i, j))
    v_rel = to_body(p_i, v_i - v_j - cross(w_j, r_i - r_j))
    return relative(Pose(r_j, p_j), Pose(r_i, p_i)), np.concatenate(
        [v_rel, to_body(p_i, w_i - w_j)], axis=-1
    )


def _of(values: Floats, bodies: Integers, ground: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Floats:
    """(nt, m, k) of bodies, of which 0 is ground."""
    return np.where((bodies > 0)[:, None], values[:, bodies - 1], ground)


def coordinates(motion: JointMotions, pose: Pose) -> Floats:
    """Q (..., m, d) of poses (..., m) of bodies i relative to bodies j; angles in (-pi, pi]."""
    gone = compose(inverse(motion.start), pose)
    q = np.zeros((*gone.r.shape[:-1], motion.size))
    if [part.kind for part in motion.parts] == [BALL]:
        axes = motion.screws[..., 3:]
        q[...] = np.einsum("mda,...ma->...md", axes, rotation_vector(gone.p))
        return q
    shifts = [k for k, part in enumerate(motion.parts) if part.kind == TRANSLATION]
    turns = [k for k, part in enumerate(motion.parts) if part.kind != TRANSLATION]
    if len(turns) == 1:
        q[..., turns[0]] = _angle_of(gone.p, motion.screws[:, turns[0], 3:])
    elif turns:
        q[..., turns[0]], q[..., turns[1]] = _two_angles(motion, gone, *turns)
    directions, turned = [], Pose(np.zeros_like(gone.r), np.zeros_like(gone.p))
    turned.p[..., 0] = 1.0
    for k in range(len(motion.parts)):
        if k in shifts:
            directions.append(to_global(turned.p, motion.screws[:, k, :3]))
        else:
            turned = compose(turned, exponential(motion.screws[:, k] * q[..., k, None]))
    if shifts:
        q[..., shifts] = _combination(np.stack(directions, axis=-1), gone.r - turned.r)
    return q


def _angle_of(p: Floats, axis: Floats) -> Floats:
    """Angles in (-pi, pi] of rotations (..., m, 4) about axes (m, 3)."""
    angle = 2.0 * np.arctan2(np.sum(p[..., 1:] * axis, axis=-1), p[..., 0])
    return angle - TURN * np.ceil(angle / TURN - 0.5)


def _angle_about(u: Floats, v: Floats, axis: Floats) -> Floats:
    """Angles in (-pi, pi] from u to v about axes, of vectors (..., m, 3)."""
    along_u, along_v = np.sum(u * axis, axis=-1), np.sum(v * axis, axis=-1)
    sine = np.sum(axis * cross(u, v), axis=-1)
    return np.arctan2(sine, np.sum(u * v, axis=-1) - along_u * along_v)


def _two_angles(motion: JointMotions, gone: Pose, one: int, two: int) -> tuple[Floats, Floats]:
    """The angles about two axes, of which the second one goes along with the first."""
    first, second = motion.screws[:, one], motion.screws[:, two]
    w, u = first[:, 3:], second[:, 3:]
    across = np.linalg.norm(cross(w, u), axis=-1)
    angle: Floats = _angle_about(u, to_global(gone.p, u), w)
    centre, moved = cross(w, first[:, :3]), cross(u, second[:, :3])
    carried = gone.r + to_global(gone.p, moved)  # no rotation about the second axis moves it
    about = _angle_about(moved - centre, carried - centre, w)
    angle = np.where(across > PARALLEL, angle, about)
    back = exponential(-np.concatenate([np.zeros_like(w), w], axis=-1) * angle[..., None])
    rest = compose(back, gone).p
    return angle, _angle_of(rest, u)


def _combination(directions: Floats, vectors: Floats) -> Floats:
    """Coefficients (..., k) of vectors (..., 3) as combinations of columns (..., 3, k)."""
    transposed = np.swapaxes(directions, -1, -2)
    x: Any = np.linalg.solve(transposed @ directions, transposed @ vectors[..., None])[..., 0]
    return np.asarray(x, dtype=float)


def coordinate_rates(motion: JointMotions, q: Floats, twist: Floats) -> Floats:
    """q_dot (..., m, d) at coordinates q (..., m, d) of relative twists (..., m, 6)."""
    if not motion.size:
        return np.zeros_like(q)
    if [part.kind for part in motion.parts] == [BALL]:
        axes = motion.screws[..., 3:]
        vector = np.einsum("mda,...md->...ma", axes, q)
        return np.einsum("mda,...ma->...md", axes, _vector_rate(vector, twist[..., 3:]))
    columns: list[Floats] = []
    pose = identity(1)
    for k in reversed(range(len(motion.parts))):  # seen from behind the parts that follow
        back = adjoint(inverse(pose))
        columns.append(np.einsum("...mab,mb->...ma", back, motion.screws[:, k]))
        pose = compose(exponential(motion.screws[:, k] * q[..., k, None]), pose)
    J = np.stack(np.broadcast_arrays(*columns[::-1]), axis=-1)
    return _combination(J, twist)


def _vector_rate(vector: Floats, w: Floats) -> Floats:
    """The rate of rotation vectors (..., 3) of body i that turns with w (..., 3), in its axes."""
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    safe = np.where(half > 1e-4, half, 1.0)
    # (1 - half cot half) / (2 half)^2, which begins with 1/12
    factor = np.where(half > 1e-4, (1.0 - safe / np.tan(safe)) / (4.0 * safe**2), 1.0 / 12.0)
    across = cross(vector, w)
    return w + 0.5 * across + factor * cross(vector, across)


def count_turns(motion: JointMotions, t: Floats, q: Floats, q_dot: Floats) -> None:
    """Add whole turns to angles q (nt, m, d) in place, so that they go on as their rates tell."""
    for k, part in enumerate(motion.parts):
        if part.kind in (BALL, TRANSLATION) or len(t) < 2:
            continue
        ahead = 0.5 * np.diff(t)[:, None] * (q_dot[1:, :, k] + q_dot[:-1, :, k])
        change = np.diff(q[..., k], axis=0)
        turns = np.cumsum(np.rint((ahead - change) / TURN), axis=0)
        q[1:, :, k] += TURN * turns


#: Loops that motions are found by.
KINDS = ("position", "acceleration", "angle")
#: The motions found last, with their angles, by what they follow from: scripts and studies compile
#: the same scene again and again, and to find its motions takes a third of that.
_found: dict[Any, tuple[ModelMotions, JointAngles]] = {}
KEPT = 64


def joint_angles(motions: ModelMotions) -> JointAngles:
    """The angles of all joints with one or two rotations, in the order of the joints."""
    parts = [part for motion in motions.motions for part in _angles_of(motion)]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] or [
        np.zeros((0, 2), dtype=np.int64),
        np.zeros((0, 2), dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, at.CONSTANT_WIDTH)),
    ]
    order = np.lexsort(columns[0].T[::-1])
    return JointAngles(*(column[order] for column in columns))


def _angles_of(motion: JointMotions) -> Iterator[tuple[Integers, Integers, Integers, Floats]]:
    """Columns of ``JointAngles`` of the joints of a motion, for each of its rotations."""
    columns = angle_columns(motion)
    if not columns:
        return
    count = len(motion.joints)
    constants = np.zeros((count, at.CONSTANT_WIDTH))
    first, last = motion.screws[:, columns[0]], motion.screws[:, columns[-1]]
    constants[:, at.P_0 : at.P_0 + 4] = motion.start.p
    constants[:, at.R_0 : at.R_0 + 3] = motion.start.r
    constants[:, at.AXIS_1 : at.AXIS_1 + 3] = first[:, 3:]
    constants[:, at.AXIS_2 : at.AXIS_2 + 3] = last[:, 3:]
    across = np.linalg.norm(cross(first[:, 3:], last[:, 3:]), axis=-1)
    parallel = (across <= PARALLEL) & (len(columns) > 1)
    point = cross(last[:, 3:], last[:, :3])
    constants[:, at.ARM : at.ARM + 3] = np.where(parallel[:, None], point, last[:, 3:])
    constants[:, at.CENTRE : at.CENTRE + 3] = cross(first[:, 3:], first[:, :3])
    constants[:, at.IS_POINT] = parallel
    bodies = np.column_stack([motion.body_i, motion.body_j])
    for k, column in enumerate(columns):
        rotation = at.ONLY if len(columns) == 1 else (at.FIRST, at.SECOND)[k]
        places = np.column_stack([motion.joints, np.full(count, column)])
        yield places, bodies, np.full(count, rotation), constants


def with_motions(model: Model, known: Model | None = None) -> Model:
    """The model with the motions of its joints, and the angles that are counted.

    Found once: they are those that the model has, if it has them, or a known one with the same
    joints and poses.

    Raises:
        PluginError: the kernels of a type cannot be compiled.
    """
    if model.motions is not None:
        return model
    if not model.joints:
        none = ModelMotions((), {})
        return attrs.evolve(model, motions=none, joint_angles=joint_angles(none))
    if known is not None and _has_same_joints(model, known):
        return attrs.evolve(model, motions=known.motions, joint_angles=known.joint_angles)
    from dap3d_core.assembly.motion.classify import classify

    key = _origin_of_motions(model)
    if key not in _found:
        for old in list(_found)[: 1 - KEPT]:
            _found.pop(old, None)
        motions = classify(model)
        _found[key] = motions, joint_angles(motions)
    motions, angles = _found[key]
    return attrs.evolve(model, motions=motions, joint_angles=angles)


def _origin_of_motions(model: Model) -> Any:
    """All that the motions of a model's joints follow from, to be compared."""
    groups = []
    for group in model.joints:
        loops = tuple(compiled_loop(group.type_info, kind) for kind in KINDS)
        places = (group.members, group.bodies, group.functions)
        numbers = group.packed_numbers(0).tobytes()
        groups.append((group.type_info.type, loops, numbers, *(a.tobytes() for a in places)))
    arrays = (model.mass, model.Jp, model.u0, model.r_0, model.p_0)
    return (*groups, model.part_size, *(a.tobytes() for a in arrays))


def _has_same_joints(model: Model, other: Model) -> bool:
    """True if joints and poses of two models of one structure are equal."""
    pairs = [
        (getattr(model, name), getattr(other, name))
        for name in ("r", "p", "r_0", "p_0", "mass", "Jp")
    ]
    pairs += [
        (mine.packed_numbers(0), theirs.packed_numbers(0))
        for mine, theirs in zip(model.joints, other.joints, strict=True)
    ]
    return all(np.array_equal(mine, theirs) for mine, theirs in pairs)
