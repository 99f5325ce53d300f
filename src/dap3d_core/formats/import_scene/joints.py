"""Joints of a model as joints of a scene: body i is the child, body j the parent."""

from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.interface.formats.articulation import WORLD, Joint
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.interface.formats.joint_motion import reversed_joint
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.kernels.array_types import Floats


def add_joint(builder: SceneBuilder, joint: Joint) -> None:
    """Add a joint.

    Raises:
        FormatError: no type of the scene is this joint.
    """
    if joint.kind not in _ADDERS:
        raise FormatError(f"joint {joint.name}: no type of the scene is {joint.kind}", joint.place)
    _ADDERS[joint.kind](JointEnds(builder, from_ground(builder, joint)))


def from_ground(builder: SceneBuilder, joint: Joint) -> Joint:
    """The same joint, with parent and child exchanged where the child is ground: body i moves."""
    if builder.member[joint.child][0] != WORLD:
        return joint
    return reversed_joint(joint)


class JointEnds:
    """The two ends of a joint in a scene, with points and vectors made as they are needed."""

    def __init__(self, builder: SceneBuilder, joint: Joint, name: str = "") -> None:
        """Args: the scene; a joint of the model; its name in the scene, where it has one."""
        self.builder, self.joint, self.scene = builder, joint, builder.scene
        self.child, self.on_child = builder.attached(joint.child, joint.in_child)
        self.parent, self.on_parent = builder.attached(joint.parent, joint.in_parent)
        names = builder.names
        self.name = name or names.of("joints", joint.name, joint.place, builder.remarks)

    def point(self, end: str, offset: Any = (0.0, 0.0, 0.0), suffix: str = "") -> str:
        """The name of a point at the joint's origin on the child ("i") or the parent ("j").

        Args:
            end: i or j.
            offset: (3,) from the origin, in the joint's frame.
            suffix: of the name.
        """
        body, frame = self._end(end)
        at = frame.r + frame.A @ np.asarray(offset)
        if not at.any():
            return f"{body}.O"
        return self._named("points", body, at, f"{end}{suffix}")

    def vector(self, end: str, direction: Any, suffix: str = "") -> str:
        """The name of a vector in the joint's frame, fixed in the child ("i") or the parent."""
        body, frame = self._end(end)
        components = frame.A @ np.asarray(direction, dtype=float)
        for k, letter in enumerate("xyz"):
            if np.array_equal(components, np.eye(3)[k]):
                return f"{body}.{letter}"
        return self._named("vectors", body, components, f"{end}{suffix}")

    def _named(self, table: str, body: str, vector: Floats, suffix: str) -> str:
        """The name of a point or vector of a body, which is added where there is none."""
        numbers = float_tuple(vector)
        made, key = self.builder.names.scene_names, f"{body}: {numbers}"
        if (table, key) not in made:
            name = self.builder.names.free(table, f"{self.name}_{suffix}")
            add = self.scene.add_point if table == "points" else self.scene.add_vector
            made[table, key] = add(name, body, numbers)
        return made[table, key]

    def _end(self, end: str) -> tuple[str, Frame]:
        return (self.child, self.on_child) if end == "i" else (self.parent, self.on_parent)


def named_ends(builder: SceneBuilder, joint: Joint) -> JointEnds:
    """The ends of a joint that has its name in the scene already."""
    return JointEnds(builder, joint, builder.names.scene_names["joints", joint.name])


def _add(ends: JointEnds, keyword: str, **fields: Any) -> None:
    ends.scene.add_joint(keyword, ends.name, **fields)


def _add_about_axis(ends: JointEnds, keyword: str, **more: float) -> None:
    axis = ends.joint.axes[0]
    _add(ends, keyword, P_i=ends.point("i"), P_j=ends.point("j"), a_i=ends.vector("i", axis),
         a_j=ends.vector("j", axis), **more)  # fmt: skip


def _prismatic(ends: JointEnds) -> None:
    _add(ends, "tran", P_i=ends.point("i"), P_j=ends.point("j"),
         a_j=ends.vector("j", ends.joint.axes[0]), A_c=_relative(ends))  # fmt: skip


def _fixed(ends: JointEnds) -> None:
    """A weld; for a loop, whose poses may be off, a slider and a driver that holds it."""
    if not ends.joint.closes:
        ends.scene.add_joint("weld", ends.name, body_i=ends.child, body_j=ends.parent)
        return
    axis = ends.vector("j", (0.0, 0.0, 1.0))
    P_i, P_j = ends.point("i"), ends.point("j")
    _add(ends, "tran", P_i=P_i, P_j=P_j, a_j=axis, A_c=_relative(ends))
    lock = ends.builder.names.free("joints", f"{ends.name}_lock")
    ends.scene.add_joint("drive-tran", lock, P_i=P_i, P_j=P_j, a_j=axis, length=0.0)


def _relative(ends: JointEnds) -> Any:
    """A_i^T A_j, the rotation of the parent in the child."""
    A = ends.on_child.A @ ends.on_parent.A.T
    return None if np.array_equal(A, np.eye(3)) else tuple(tuple(map(float, row)) for row in A)


def _ball(ends: JointEnds) -> None:
    _add(ends, "sph", P_i=ends.point("i"), P_j=ends.point("j"))


def _universal(ends: JointEnds) -> None:
    first, second = ends.joint.axes
    if abs(np.dot(first, second)) > 1e-9:
        what = f"joint {ends.joint.name}: the axes of a universal joint are perpendicular"
        raise FormatError(what, ends.joint.place)
    _add(ends, "univ", P_i=ends.point("i"), P_j=ends.point("j"), a_i=ends.vector("i", second),
         n_j=ends.vector("j", first))  # fmt: skip


#: Kind of a joint of a model -> what adds it.
_ADDERS: dict[str, Callable[[JointEnds], None]] = {
    "revolute": lambda ends: _add_about_axis(ends, "rev"),
    "cylindrical": lambda ends: _add_about_axis(ends, "cyl"),
    "screw": lambda ends: _add_about_axis(ends, "screw", pitch=ends.joint.pitch),
    "prismatic": _prismatic, "fixed": _fixed, "ball": _ball, "universal": _universal,
}  # fmt: skip
