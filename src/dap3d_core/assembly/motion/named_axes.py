"""Axes and centres of motions by the names of a type's fields, to which they are aligned."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.assembly.motion.joint_motion import BALL, ROTATION, TRANSLATION
from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.model import Group
from dap3d_core.model.rigid_motion import Pose
from dap3d_core.model.rotations import to_body

#: Sine of the angle of two directions, and distance in units of the scene's length, that are one.
SAME = 1e-9


class Named(NamedTuple):
    """A vector or point of a type, of m joints.

    Attributes:
        name: of the field, or constant of ``prepare``.
        slot: of the body that it is fixed in.
        local: (m, 3) in the axes of that body.
        value: (m, 3) in the axes of body i, from its mass centre, in its pose T0.
    """

    name: str
    slot: str
    local: Floats
    value: Floats


def vectors(group: Group, start: Pose) -> list[Named]:
    """The unit vectors that a type names, those of body j first, fields before constants."""
    layout = group.type_info.layout
    fields = [n for n, spec in specs_of(group.type_info.type).items() if spec.kind == "vector"]
    constants = [n for n in layout.constants if layout.numbers[n][1] == (3,)]
    names = [n for n in (*fields, *constants) if n in layout.numbers]
    found = []
    for name, slot, local in _fixed(group, names):
        length = np.linalg.norm(local, axis=-1, keepdims=True)
        if np.all(np.abs(length - 1.0) < SAME):
            unit = local / length
            value = unit if slot == layout.slots[0] else to_body(start.p, unit)
            found.append(Named(name, slot, unit, value))
    return sorted(found, key=lambda named: named.slot == layout.slots[0])


def points(group: Group, start: Pose) -> list[Named]:
    """The points that a type names, those of body j first."""
    layout = group.type_info.layout
    fields = [n for n, spec in specs_of(group.type_info.type).items() if spec.kind == "point"]
    ends = [n for n in ("P_i", "P_j") if n not in fields]
    found = []
    for name, slot, local in _fixed(group, [n for n in (*fields, *ends) if n in layout.numbers]):
        is_i = slot == layout.slots[0]
        value = local if is_i else to_body(start.p, local - start.r)
        found.append(Named(name, slot, local, value))
    return sorted(found, key=lambda named: named.slot == layout.slots[0])


def _fixed(group: Group, names: list[str]) -> Iterator[tuple[str, str, Floats]]:
    """(name, slot, local components (m, 3)) of those of the names that are fixed in a body."""
    layout = group.type_info.layout
    for name in names:
        slot = slot_of(name)
        if slot in layout.slots:
            offset = layout.numbers[name][0]
            yield name, slot, group.numbers[:, offset : offset + 3]


def aligned(
    kinds: tuple[str, ...], screws: Floats, named: list[Named], centres: list[Named], length: float
) -> tuple[tuple[str, ...], Floats]:
    """Names of axes and centres, "" for none, and twists (m, d, 6) that are aligned with them.

    Twists that differ from named axes by rounding become these, with their sense; several
    translations are turned so that they go along named vectors, where there are such.
    """
    screws = screws.copy()
    names: list[str] = [""] * len(kinds)
    shifts = kinds.count(TRANSLATION)
    if shifts > 1:
        names[:shifts] = _turn_translations(screws[:, :shifts, :3], named)
    elif shifts:
        names[0], screws[:, 0, :3] = _align(screws[:, 0, :3], named)
    if kinds[shifts:] == (BALL,):
        centre = 0.5 * np.sum(np.cross(screws[..., 3:], screws[..., :3]), axis=1)
        for point in centres:
            if np.all(np.linalg.norm(point.value - centre, axis=-1) < SAME * length):
                names[shifts] = point.name
                screws[..., :3] = np.cross(point.value[:, None], screws[..., 3:])
                break
    elif kinds[shifts:]:
        names[shifts], screws[:, shifts] = _align_turn(
            kinds[shifts], screws[:, shifts], named, centres, length
        )
    return tuple(names), screws


def _align_turn(
    kind: str, screw: Floats, named: list[Named], centres: list[Named], length: float
) -> tuple[str, Floats]:
    """The name of the axis of a rotation or screw (m, 6), and the same about it exactly."""
    v, old = screw[:, :3], screw[:, 3:]
    name, w = _align(old, named)
    centre, pitch = np.cross(old, v), np.sum(v * old, axis=-1, keepdims=True)
    for point in centres:
        arm = point.value - centre
        off = arm - w * np.sum(arm * w, axis=-1, keepdims=True)
        if np.all(np.linalg.norm(off, axis=-1) < SAME * length):
            centre = point.value
            break
    v = np.cross(centre, w)
    if kind != ROTATION:
        v = v + pitch * w
    return name, np.concatenate([v, w], axis=-1)


def _align(axis: Floats, named: list[Named]) -> tuple[str, Floats]:
    """The first named vector along axes (m, 3), and the axes with its sense and exact numbers.

    Numbers are those of a vector of body i, which are constant there; where none is along it, the
    sense is that of the largest component.
    """
    matches = [n for n in named if np.all(np.linalg.norm(np.cross(n.value, axis), axis=-1) < SAME)]
    if not matches:
        largest = np.take_along_axis(axis, np.argmax(np.abs(axis), axis=-1)[:, None], axis=-1)
        return "", axis * np.sign(largest)
    first, exact = matches[0], matches[-1]
    sense = np.sign(np.sum(first.value * exact.value, axis=-1, keepdims=True))
    return first.name, sense * exact.value


def _turn_translations(shifts: Floats, named: list[Named]) -> list[str]:
    """Turn orthonormal directions (m, k, 3) in place along named vectors; their names."""
    k = shifts.shape[1]
    chosen: list[Named] = []
    for vector in named:
        inside = np.einsum("mkc,mc->mk", shifts, vector.value)
        is_inside = np.all(np.abs(np.linalg.norm(inside, axis=-1) - 1.0) < SAME)
        is_normal = all(
            np.all(np.abs(np.sum(vector.value * c.value, axis=-1)) < SAME) for c in chosen
        )
        if is_inside and is_normal and len(chosen) < k:
            chosen.append(vector)
    projector = np.einsum("mka,mkb->mab", shifts, shifts)
    columns = [c.value for c in chosen]
    for axis in np.eye(3):  # the rest: coordinate axes of body i in T0, made normal to those before
        if len(columns) == k:
            break
        rest = projector @ axis
        for column in columns:
            rest = rest - column * np.sum(column * rest, axis=-1, keepdims=True)
        size = np.linalg.norm(rest, axis=-1, keepdims=True)
        if np.all(size > 0.5):
            columns.append(rest / size)
    if len(columns) == k:
        shifts[:] = np.stack(columns, axis=1)
    return [c.name for c in chosen] + [""] * (k - len(chosen))
