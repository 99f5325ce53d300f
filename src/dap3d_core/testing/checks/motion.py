"""The motion that a joint type leaves free, found for random joints of it."""

import random

import numpy as np

from dap3d_core.assembly.motion.classify import classify_group
from dap3d_core.assembly.motion.joint_motion import JointMotions
from dap3d_core.assembly.motion.refusals import (
    NOT_CLOSED,
    NOT_CONSTANT,
    ON_TIME,
    refusal_of,
    refused_joints,
)
from dap3d_core.assembly.motion.wording import axis_words, motion_words
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import specs_of
from dap3d_core.model import Group
from dap3d_core.model.rigid_motion import Pose, relative
from dap3d_core.testing.checks.findings import TypeMotion
from dap3d_core.testing.samples.random_element import RandomElement, RefusalError, draw
from dap3d_core.testing.samples.random_state import State, random_state
from dap3d_core.testing.samples.sampled_type import UNDEFINED, SampledType

#: Random joints that must agree, and the most that are drawn to find so many.
JOINTS, DRAWN = 3, 24


def motion_of_type(subject: SampledType) -> TypeMotion:
    """The motion that random joints of a type have in common, or why there is none.

    Functions of time are absent where the type allows it.

    Raises:
        PluginError: the kernels of the type cannot be compiled.
    """
    reason = refusal_of(subject.type_info)
    if reason and subject.type.drives and not subject.type.velocity_rows():
        reason = ON_TIME
    found: list[tuple[JointMotions | None, str]] = []
    rng = random.Random(f"{subject.seed} {subject.type.__qualname__} motion")
    for _ in range(DRAWN):
        if reason or len(found) == JOINTS:
            break
        verdict = _verdict(subject, rng)
        if verdict is not None:
            found.append(verdict)
    reasons = {why for _, why in found} or {reason or NOT_CLOSED}
    motions = [motion for motion, _ in found if motion is not None]
    if len(motions) < len(found) or not found or len({motion.parts for motion in motions}) > 1:
        why = next(iter(reasons)) if len(reasons) == 1 else NOT_CONSTANT
        return TypeMotion(subject.variant, f"refused: {why}", None)
    axes = [axis_words(motion) for motion in motions]
    common = [of[0] if len(set(of)) == 1 else "" for of in zip(*axes, strict=True)]
    parts = motions[0].parts
    return TypeMotion(subject.variant, motion_words(parts, common), parts)


def _verdict(subject: SampledType, rng: random.Random) -> tuple[JointMotions | None, str] | None:
    """The motion of a random joint, or the reason why it has none; None if there is no joint."""
    type_info = subject.type_info
    specs = specs_of(subject.type)
    given = [specs[name].required for name in type_info.layout.functions]
    state = random_state(rng, given, grounded=False)
    try:
        group = _group_of(type_info, draw(type_info, subject.drawn_choices, rng, state))
    except (RefusalError, *UNDEFINED):
        return None
    if reasons := refused_joints(group):
        return None, reasons[0]
    pose = relative(*(_pose(state, b) for b in (2, 1)))
    if len(type_info.layout.slots) == 1:
        pose = _pose(state, 1)
    motions, reasons = classify_group(group, state.mass, state.Jp.reshape(-1, 3, 3), pose)
    if not motions:
        return None if reasons[0] == NOT_CLOSED else (None, reasons[0])
    return motions[0], ""


def _group_of(type_info: TypeInfo, element: RandomElement) -> Group:
    """A group of one random joint."""
    layout, par = type_info.layout, np.array(element.par)
    slots = len(layout.slots)
    tables = []
    for offset, columns in layout.tables.values():
        start, count = int(par[offset]), int(par[offset + 1])
        tables.append((0, offset, par[start : start + count * columns].reshape(count, columns)))
    idx = np.array([element.idx], dtype=np.int64)
    return Group(type_info, np.array([0]), idx[:, :slots], idx[:, slots : layout.integers],
                 par[None, : layout.par_width], tuple(tables))  # fmt: skip


def _pose(state: State, body: int) -> Pose:
    return Pose(state.r[body : body + 1], state.p[body : body + 1])
