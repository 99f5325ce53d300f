"""Motions of joints in words, for messages and reports."""

from collections.abc import Sequence
from itertools import groupby

from dap3d_core.assembly.arrays import Floats
from dap3d_core.assembly.motion.joint_motion import BALL, TRANSLATION, JointMotions, Part
from dap3d_core.model.rotations import to_global

NO_MOTION = "none: the bodies move as one"
#: Components of an axis below this are printed as zero.
SMALL = 5e-7


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


def axis_words(motion: JointMotions, joint: int = 0) -> list[str]:
    """Of each part without a name, its axis in the axes of the body that it is constant in."""
    words = []
    for k, part in enumerate(motion.parts):
        axis = motion.axis(k)[joint]
        if part.constant_in != motion.slots[0]:
            axis = to_global(motion.start.p[joint], axis)
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
