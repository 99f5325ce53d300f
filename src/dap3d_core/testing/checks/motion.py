"""The motion that a joint type leaves free, found for random joints of it."""

import random
from collections.abc import Sequence
from itertools import groupby, islice

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.assembly.motion.classify import classify_group
from dap3d_core.assembly.motion.joint_motion import BALL, TRANSLATION, JointMotions, Part
from dap3d_core.assembly.motion.joint_rows import NOT_CLOSED, ON_TIME, refusal_of, refused_joints
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import specs_of
from dap3d_core.model import Group
from dap3d_core.model.rigid_motion import Pose, relative
from dap3d_core.model.rotations import to_global
from dap3d_core.testing.checks.findings import TypeMotion
from dap3d_core.testing.samples.random_element import RandomElement, RefusalError, draw
from dap3d_core.testing.samples.random_state import State, random_state
from dap3d_core.testing.samples.sampled_type import UNDEFINED, SampledType, given_rows

NO_MOTION = "none: the bodies move as one"
#: Components of an axis below this are printed as zero.
SMALL = 5e-7

#: Random joints that must agree, and the most that are drawn to find so many.
JOINTS, DRAWN = 3, 24
DIFFERENT = "its motion is another for other values of its fields"


def motion_of_type(subject: SampledType) -> TypeMotion:
    """The motion that random joints of a type have in common, or why there is none.

    Functions of time are absent where the type allows it.

    Raises:
        PluginError: the kernels of the type cannot be compiled.
    """
    reason = refusal_of(subject.type_info)
    if reason:
        drives = subject.type.drives and not subject.type.velocity_rows()
        return _refused(subject, ON_TIME if drives else reason)
    rng = random.Random(f"{subject.seed} {subject.type.__qualname__} motion")
    drawn = (_verdict(subject, rng) for _ in range(DRAWN))
    found = list(islice((verdict for verdict in drawn if verdict is not None), JOINTS))
    motions = [motion for motion, _ in found if motion is not None]
    reasons = {reason for _, reason in found}
    if not motions:
        return _refused(subject, reasons.pop() if len(reasons) == 1 else NOT_CLOSED)
    parts = motions[0].parts
    if len(motions) < len(found) or any(motion.parts != parts for motion in motions):
        return _refused(subject, DIFFERENT)
    axes = zip(*map(axis_words, motions), strict=True)
    common = [words[0] if len(set(words)) == 1 else "" for words in axes]
    return TypeMotion(subject.variant, motion_words(parts, common), parts)


def _refused(subject: SampledType, reason: str) -> TypeMotion:
    return TypeMotion(subject.variant, f"rows stay: {reason}", None)


def _verdict(subject: SampledType, rng: random.Random) -> tuple[JointMotions | None, str] | None:
    """The motion of a random joint, or the reason why it has none; None if there is no joint."""
    type_info = subject.type_info
    specs = specs_of(subject.type)
    given = given_rows(type_info, lambda: False)
    names = type_info.layout.functions
    given = [specs[n].required or one for n, one in zip(names, given, strict=True)]
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
    slots, others = len(layout.slots), len(layout.functions) + len(layout.others)
    tables = []
    for offset, columns in layout.tables.values():
        start, count = int(par[offset]), int(par[offset + 1])
        tables.append((0, offset, par[start : start + count * columns].reshape(count, columns)))
    idx = np.array([element.idx], dtype=np.int64)
    return Group(type_info, np.array([0]), idx[:, :slots], idx[:, slots : slots + others],
                 par[None, : layout.par_width], tuple(tables))  # fmt: skip


def _pose(state: State, body: int) -> Pose:
    return Pose(state.r[body : body + 1], state.p[body : body + 1])


def motion_words(parts: Sequence[Part], axes: Sequence[str] = ()) -> str:
    """A motion such as "1 rotation about a_j, constant in body j".

    Args:
        parts: its elementary motions.
        axes: words for the axis of each part that has no name; "" for none.
    """
    if not parts:
        return NO_MOTION
    axes = axes or [""] * len(parts)
    texts = []
    for slot, of_slot in groupby(
        zip(parts, axes, strict=True), key=lambda pair: pair[0].constant_in
    ):
        kinds = [
            _alike(list(alike)) for _, alike in groupby(of_slot, key=lambda pair: pair[0].kind)
        ]
        where = "ground" if slot == "ground" else f"body {slot}"
        texts.append(f"{' and '.join(kinds)}, constant in {where}")
    return ", and ".join(texts)


def axis_words(motion: JointMotions) -> list[str]:
    """Of each part without a name, its axis in the axes of the body that it is constant in."""
    words = []
    for k, part in enumerate(motion.parts):
        axis = motion.axis(k)[0]
        if part.constant_in != motion.slots[0]:
            axis = to_global(motion.start.p[0], axis)
        words.append("" if part.name or part.kind == BALL else _vector(axis))
    return words


def _alike(pairs: list[tuple[Part, str]]) -> str:
    """Parts of the same kind that are constant in the same body."""
    kind = pairs[0][0].kind
    count = sum(part.size for part, _ in pairs)
    noun = "rotation" if kind == BALL else kind
    names = [name for part, axis in pairs if (name := part.name or axis)]
    preposition = "along" if kind == TRANSLATION else "about"
    if not names and kind == BALL:
        names = ["a point"]
    where = f" {preposition} {' and '.join(names)}" if names else ""
    return f"{count} {noun}{'s' * (count > 1)}{where}"


def _vector(axis: Floats) -> str:
    """Three components of a direction."""
    return f"({', '.join(f'{0.0 if abs(x) < SMALL else x:.6g}' for x in axis.tolist())})"
