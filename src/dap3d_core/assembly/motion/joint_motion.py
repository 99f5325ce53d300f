"""The motion that a joint leaves free, as a product of elementary motions about fixed axes.

Axes and centres have the names of the type's fields with which they are aligned.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.model import Group
from dap3d_core.model.rigid_motion import Pose, adjoint, compose, cross, exponential, inverse
from dap3d_core.model.rotations import to_body, to_global

#: Kinds of the parts of a motion: about an axis, along one, both in a fixed ratio, about a point.
ROTATION, TRANSLATION, SCREW, BALL = "rotation", "translation", "screw", "ball"


@attrs.frozen
class Part:
    """One elementary motion of a type of joint.

    Attributes:
        kind: ROTATION, TRANSLATION, SCREW or BALL.
        constant_in: the slot of the body that its axis is fixed in, or "ground".
        name: the field, or name of ``prepare``, that is its axis or centre; "" where there is none.
    """

    kind: str
    constant_in: str
    name: str = ""

    @property
    def size(self) -> int:
        """Number of its coordinates."""
        return 3 if self.kind == BALL else 1


@attrs.frozen(eq=False)
class JointMotions:
    """Motions of the same kind, of m joints of one type.

    The pose of body i relative to body j (mass centre and axes of body j, or ground) is

        T = T0 exp(s_1 q_1) exp(s_2 q_2) ...

    with constant twists s = (v, w) in the axes of body i at its mass centre. T0 is the pose as
    given, moved onto C = 0, so that coordinates q are zero there. Positive rotations are
    right-handed, and positive translations go along, the axis; both are those of body i as seen
    from body j.

    Attributes:
        keyword: of the type.
        slots: those of the type's two bodies, which are called i and j here; or i and "ground".
        parts: the elementary motions, from body j to body i; of a BALL q is a rotation vector.
        joints: (m,) places among the joints of the model.
        body_i, body_j: (m,) bodies, ground 0.
        start: T0.
        screws: (m, d, 6) the twists s in m and 1; a BALL has three.
    """

    keyword: str
    slots: tuple[str, str]
    parts: tuple[Part, ...]
    joints: Integers
    body_i: Integers
    body_j: Integers
    start: Pose
    screws: Floats

    @property
    def size(self) -> int:
        """Number of joint coordinates."""
        return sum(part.size for part in self.parts)

    @property
    def columns(self) -> tuple[slice, ...]:
        """Of each part, its coordinates."""
        ends = np.cumsum([0, *(part.size for part in self.parts)]).tolist()
        return tuple(map(slice, ends[:-1], ends[1:]))

    def axis(self, part: int) -> Floats:
        """(m, 3) unit axes of a part, in the axes of body i in its pose T0; zeros for a BALL."""
        kind, twist = self.parts[part].kind, self.screws[:, self.columns[part]]
        if kind == BALL:
            return np.zeros((len(self.joints), 3))
        return twist[:, 0, :3] if kind == TRANSLATION else twist[:, 0, 3:]

    def point(self, part: int) -> Floats:
        """(m, 3) the point of a part's axis next to the mass centre of body i, or its centre."""
        twist = self.screws[:, self.columns[part]]
        arms: Floats = np.sum(cross(twist[..., 3:], twist[..., :3]), axis=1)
        arms *= 0.5 if self.parts[part].kind == BALL else 1.0
        return arms

    def pitch(self, part: int) -> Floats:
        """(m,) advance of a part along its axis in m/rad; zero but of a SCREW."""
        twist = self.screws[:, self.columns[part]][:, 0]
        if self.parts[part].kind != SCREW:
            return np.zeros(len(twist))
        return np.sum(twist[:, :3] * twist[:, 3:], axis=-1)

    def units(self, length: float) -> Floats:
        """(d,) of each coordinate, 1 rad for an angle and a length, m, for a length."""
        sizes = [
            length if p.kind == TRANSLATION else 1.0 for p in self.parts for _ in range(p.size)
        ]
        return np.array(sizes)

    def pose(self, q: Floats) -> Pose:
        """The poses (m) of bodies i relative to bodies j at joint coordinates q (m, d)."""
        pose = self.start
        for columns in self.columns:
            twist = np.einsum("mda,md->ma", self.screws[:, columns], q[:, columns])
            pose = compose(pose, exponential(twist))
        return pose

    def take(self, index: Integers) -> "JointMotions":
        """The motions of some of the joints, by their places in these arrays."""
        r, p = self.start.r[index], self.start.p[index]
        body_i, body_j = self.body_i[index], self.body_j[index]
        return attrs.evolve(self, joints=self.joints[index], body_i=body_i, body_j=body_j,
                            start=Pose(r, p), screws=self.screws[index])  # fmt: skip

    def reversed(self) -> "JointMotions":
        """The motions of bodies j relative to bodies i, by the same coordinates, last part first.

        T^-1 = T0^-1 ... exp(-Ad s_2 q_2) exp(-Ad s_1 q_1), with Ad that of T0.
        """
        moved = -np.einsum("mab,mdb->mda", adjoint(self.start), self.screws)
        columns = [moved[:, c] for c in reversed(self.columns)]
        screws = np.concatenate([moved[:, :0], *columns], axis=1)  # a weld has no columns
        return attrs.evolve(
            self,
            slots=self.slots[::-1],
            parts=self.parts[::-1],
            body_i=self.body_j,
            body_j=self.body_i,
            start=inverse(self.start),
            screws=screws,
        )


@attrs.frozen(eq=False)
class ModelMotions:
    """The motions of the joints of a model.

    Attributes:
        motions: of joints whose motion is known.
        refused: place of a joint -> the reason why its rows are kept.
    """

    motions: tuple[JointMotions, ...]
    refused: Mapping[int, str]

    def of(self, joint: int) -> JointMotions | None:
        """The motion of one joint by its place among those of the model; None where refused."""
        for motions in self.motions:
            places = np.flatnonzero(motions.joints == joint)
            if places.size:
                return motions.take(places)
        return None


def merged(motions: Sequence[JointMotions]) -> tuple[JointMotions, ...]:
    """The same motions, those of one type and the same parts side by side, in order of joints."""
    alike: dict[Any, list[JointMotions]] = {}
    for motion in motions:
        alike.setdefault((motion.keyword, motion.slots, motion.parts), []).append(motion)
    return tuple(_joined(some) for some in alike.values())


def _joined(motions: list[JointMotions]) -> JointMotions:
    joints, body_i, body_j, r, p, screws = (
        np.concatenate(arrays)
        for arrays in zip(
            *((m.joints, m.body_i, m.body_j, *m.start, m.screws) for m in motions), strict=True
        )
    )
    order = np.argsort(joints)
    whole = attrs.evolve(motions[0], joints=joints, body_i=body_i, body_j=body_j,
                         start=Pose(r, p), screws=screws)  # fmt: skip
    return whole.take(order)


#: Sine of the angle of two directions, and distance in units of the scene's length, that are one.
SAME = 1e-9


class Named(NamedTuple):
    """A unit vector or a point of a type, of m joints.

    Attributes:
        name: of the field, or of the constant of ``prepare``.
        slot: of the body that it is fixed in.
        value: (m, 3) in the axes of body i, from its mass centre, in its pose T0.
    """

    name: str
    slot: str
    value: Floats


class NamedAxes:
    """What a type names in one of the bodies of a joint, or in both.

    Attributes:
        slots: of these bodies, body i first; "ground" where a type has one slot.
        vectors, points: those that are fixed there, of body j first, fields before constants.
    """

    def __init__(self, group: Group, start: Pose, slots: tuple[str, ...], length: float) -> None:
        """Args:
        group: of m joints.
        start: T0, poses of bodies i relative to bodies j.
        slots: the bodies that count.
        length: m, of the scene.
        """
        self.slots, self._length = slots, length
        slot_i = group.type_info.layout.slots[0]
        in_i = slots[-1] == slot_i
        self._seen = np.broadcast_to([1.0, 0.0, 0.0, 0.0], start.p.shape) if in_i else start.p
        self.vectors: list[Named] = []
        self.points: list[Named] = []
        for name, slot, local in _fixed(group, "vector"):
            size = np.linalg.norm(local, axis=-1, keepdims=True)
            if slot in slots and np.all(np.abs(size - 1.0) < SAME):
                unit = local / size
                value = unit if slot == slot_i else to_body(start.p, unit)
                self.vectors.append(Named(name, slot, value))
        for name, slot, local in _fixed(group, "point"):
            if slot in slots:
                value = local if slot == slot_i else to_body(start.p, local - start.r)
                self.points.append(Named(name, slot, value))
        for named in (self.vectors, self.points):
            named.sort(key=lambda item: item.slot == slot_i)

    def aligned(self, kinds: tuple[str, ...], screws: Floats) -> tuple[tuple[Part, ...], Floats]:
        """Parts with the names of their axes and centres, and twists aligned with them.

        Twists that differ from named axes by rounding become these, with their sense; several
        translations are turned so that they go along named vectors, where there are such.

        Args:
            kinds: of the parts, translations first.
            screws: (m, d, 6) their unit twists, in m and 1.
        """
        screws = screws.copy()
        shifts = kinds.count(TRANSLATION)
        names: list[tuple[str, str]] = []
        if shifts == 1:
            name, screws[:, 0, :3] = self._along(screws[:, 0, :3])
            names.append(name)
        elif shifts:
            names += self._turn_translations(screws[:, :shifts, :3])
        if kinds[shifts:] == (BALL,):
            name, centre = self._through(0.5 * _feet(screws).sum(axis=1), np.zeros((1, 3)))
            screws[..., :3] = cross(centre[:, None], screws[..., 3:])
            names.append(name)
        elif kinds[shifts:]:
            name, screws[:, shifts] = self._about(kinds[shifts], screws[:, shifts])
            names.append(name)
        parts = (Part(kind, slot, n) for kind, (n, slot) in zip(kinds, names, strict=True))
        return tuple(parts), screws

    def _along(self, axis: Floats) -> tuple[tuple[str, str], Floats]:
        """(name, slot) of the first vector along axes (m, 3), and the axes with its sense.

        Their numbers are those of a vector of body i, which are constant there; where none is along
        them, the sense is that of the largest component.
        """
        matches = [named for named in self.vectors if _are_small(cross(named.value, axis), SAME)]
        if not matches:
            seen = to_global(self._seen, axis)
            largest = np.take_along_axis(seen, np.argmax(np.abs(seen), axis=-1)[:, None], axis=-1)
            return ("", self.slots[-1]), axis * np.sign(largest)
        first, exact = matches[0], matches[-1]
        sense = np.sign(np.sum(first.value * exact.value, axis=-1, keepdims=True))
        return (first.name, first.slot), sense * exact.value

    def _through(self, centre: Floats, axis: Floats) -> tuple[tuple[str, str], Floats]:
        """(name, slot) of the first point on lines through centres (m, 3), and such a point.

        Its numbers are those of a point of body i where one is there, as in ``_along``.
        """
        matches = []
        for named in self.points:
            arm = named.value - centre
            off = arm - axis * np.sum(arm * axis, axis=-1, keepdims=True)
            if _are_small(off, SAME * self._length):
                matches.append(named)
        if not matches:
            return ("", self.slots[-1]), centre
        return (matches[0].name, matches[0].slot), matches[-1].value

    def _about(self, kind: str, screw: Floats) -> tuple[tuple[str, str], Floats]:
        """(name, slot) of the axis of a rotation or screw (m, 6), and the same about it exactly."""
        pitch = np.sum(screw[:, :3] * screw[:, 3:], axis=-1, keepdims=True)
        name, axis = self._along(screw[:, 3:])
        _, centre = self._through(_feet(screw), axis)
        v = cross(centre, axis)
        if kind != ROTATION:
            v = v + pitch * axis
        return name, np.concatenate([v, axis], axis=-1)

    def _turn_translations(self, shifts: Floats) -> list[tuple[str, str]]:
        """Turn orthonormal directions (m, k, 3) in place along named vectors; (name, slot)."""
        count = shifts.shape[1]
        projector = np.einsum("mka,mkb->mab", shifts, shifts)
        chosen: list[Named] = []
        for named in self.vectors:
            outside = named.value - np.einsum("mab,mb->ma", projector, named.value)
            products = [np.sum(named.value * c.value, axis=-1) for c in chosen]
            if len(chosen) < count and all(_are_small(x, SAME) for x in (outside, *products)):
                chosen.append(named)
        columns = [c.value for c in chosen]
        # then coordinate axes of the body that the motion is seen from, made normal to those before
        for axis in np.eye(3):
            rest = np.einsum("mab,mb->ma", projector, to_body(self._seen, axis))
            for column in columns:
                rest = rest - column * np.sum(column * rest, axis=-1, keepdims=True)
            size = np.linalg.norm(rest, axis=-1, keepdims=True)
            if len(columns) < count and np.all(size > 0.5):
                columns.append(rest / size)
        if len(columns) == count:
            shifts[:] = np.stack(columns, axis=1)
        names = [(c.name, c.slot) for c in chosen]
        return names + [("", self.slots[-1])] * (count - len(chosen))


def _fixed(group: Group, kind: str) -> Iterator[tuple[str, str, Floats]]:
    """(name, slot, components (m, 3)) of fields of a kind, and of constants of ``prepare``."""
    layout = group.type_info.layout
    fields = [n for n, spec in specs_of(group.type_info.type).items() if spec.kind == kind]
    constants = [n for n in layout.constants if layout.numbers[n][1] == (3,)]
    ends = [n for n in ("P_i", "P_j") if n not in fields]  # of a vector between two points
    for name in (*fields, *(constants if kind == "vector" else ends)):
        slot = slot_of(name)
        if slot in layout.slots and name in layout.numbers:
            offset = layout.numbers[name][0]
            yield name, slot, group.numbers[:, offset : offset + 3]


def _feet(screws: Floats) -> Floats:
    """Points (..., 3) on the axes of unit twists (..., 6), next to the origin."""
    return cross(screws[..., 3:], screws[..., :3])


def _are_small(vectors: Floats, size: float) -> bool:
    return bool(np.all(np.abs(vectors) < size))
