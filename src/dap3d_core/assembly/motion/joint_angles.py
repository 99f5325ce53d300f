"""Constants by which the driver measures the angles of joints (assembly/turns.py)."""

from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly import turns as at
from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.coordinates import PARALLEL, angle_columns
from dap3d_core.assembly.motion.joint_motion import JointMotions, ModelMotions
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.model import Model
from dap3d_core.model.joint_angles import JointAngles
from dap3d_core.model.rigid_motion import cross

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
