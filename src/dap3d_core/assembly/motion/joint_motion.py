"""The motion that a joint leaves free, as a product of elementary motions about fixed axes."""

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.model.rigid_motion import Pose, adjoint, compose, cross, exponential, inverse

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
