"""Joints of a model as joints of a scene: body i is the child, body j the parent."""

from collections.abc import Callable, Sequence
from math import pi
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.formats.import_scene.start import couples
from dap3d_core.interface.formats.articulation import WORLD, Articulation, Joint
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.interface.formats.joint_motion import reversed_joint
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.suggestions import did_you_mean

#: Mass and inertia of a wheel that couples joints, over the least of what they move. With less,
#: methods that allow for dependent rows (lsq, joint) take the rows of two followers for one.
LIGHT = 1e-6


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
        self.name = name or builder.names.of("joints", joint.name, joint.place, builder.remarks)

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
    lock = f"{ends.name}_lock"
    ends.builder.add_joint("drive-tran", lock, P_i=P_i, P_j=P_j, a_j=axis, length=0.0)


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


def add_rotor(builder: SceneBuilder, joint: Joint, inertia: float) -> None:
    """Add a wheel on ground that turns with a joint and so adds to its inertia alone."""
    text = "armature of a joint is a wheel on ground that turns with it"
    builder.remarks.translate(joint.place, text)
    wheel = wheel_of(builder, joint, 1.0, inertia)
    follow(builder, joint, wheel, (1.0,), "rotor")


def wheel_of(builder: SceneBuilder, joint: Joint, mass: float, inertia: float) -> str:
    """The wheel of a joint, made if there is none yet: a body that turns about ground's z."""
    key = ("wheel", joint.name)
    wheel = builder.names.scene_names.get(key)
    if wheel is None:
        scene_name = builder.names.scene_names["joints", joint.name]
        wheel = builder.names.free("bodies", f"{scene_name}_rotor")
        builder.names.scene_names[key] = wheel
        add_wheel(builder, wheel, mass, inertia, (*joint.rate, 0.0)[0])
    return wheel


def add_wheel(
    builder: SceneBuilder, wheel: str, mass: float, inertia: float, rate: float = 0.0
) -> None:
    """Add a body that turns about ground's z."""
    builder.scene.add_body(wheel, mass=mass, Jp=(inertia,) * 3,
                           w=(0.0, 0.0, rate) if rate else None)  # fmt: skip
    builder.add_joint("rev", f"{wheel}_bearing", P_i=f"{wheel}.O", P_j="ground.O",
                      a_i=f"{wheel}.z", a_j="ground.z")  # fmt: skip


def follow(
    builder: SceneBuilder, joint: Joint, wheel: str, ratios: Sequence[float], suffix: str
) -> None:
    """Couple the coordinate of a joint with a wheel; the ratio is a polynomial of its angle."""
    ratio, *bends = (*ratios, 0.0, 0.0, 0.0)[:4]
    curve: dict[str, Any] = {"curved": True, "bends": tuple(bends)} if any(bends) else {}
    ends = named_ends(builder, from_ground(builder, joint))
    builder.add_joint(
        "follow", f"{ends.name}_{suffix}", body_i=ends.child,
        a_j=ends.vector("j", ends.joint.axes[0], "_axis"), a_k=f"{wheel}.z",
        ratio=None if ratio == 1.0 else ratio, along=True if joint.kind == "prismatic" else None,
        **curve,
    )  # fmt: skip


def add_couplings(builder: SceneBuilder, model: Articulation) -> None:
    """Add coordinates that follow others; what cannot be coupled is left out, remarked.

    Raises:
        FormatError: a coupling names one joint twice, or one that the model does not have.
    """
    for coupling in model.couplings:
        others = model.joints.keys() - {coupling.joint}
        if coupling.joint not in model.joints or coupling.other not in others:
            what = (
                f"{coupling.joint!r} follows {coupling.other!r}: should be two joints of the file"
            )
            raise FormatError(what, coupling.place, did_you_mean(coupling.other, others))
        one, other = model.joints[coupling.joint], model.joints[coupling.other]
        if one.kind == other.kind == "fixed":
            continue
        if not couples(model, coupling):
            text = f"coupling of {coupling.joint} with {coupling.other}: joints of one coordinate "
            builder.remarks.leave_out(coupling.place, f"{text}are coupled", motion=True)
            continue
        if builder.moves_alone(one) or builder.moves_alone(other):
            text = "coupling of a joint that does not move"
            builder.remarks.leave_out(coupling.place, text, motion=True)
            continue
        had_rotor = bool(other.armature[0])
        wheel = wheel_of(builder, other, *light(builder, one, other))
        if not had_rotor and ("followed", other.name) not in builder.names.scene_names:
            builder.names.scene_names["followed", other.name] = wheel
            text = "joints are coupled by a wheel on ground, with a millionth of the inertia"
            builder.remarks.translate(coupling.place, text)
            follow(builder, other, wheel, (1.0,), "rotor")
        start, limits = other.position[0], other.limits[0]
        if coupling.curve and max(start - limits.lower, limits.upper - start) > pi:
            text = "an equality of joints with a polynomial: it holds to half a turn from the start"
            builder.remarks.translate(coupling.place, text, motion=True)
        follow(builder, one, wheel, coupling.slopes(start), "coupling")


def light(builder: SceneBuilder, *joints: Joint) -> tuple[float, float]:
    """Mass and inertia of a wheel beside what joints move: beside its mass, for a slider."""
    masses, sizes = [], []
    for joint in joints:
        group = builder.groups[builder.member[from_ground(builder, joint).child][0]]
        mass, least = group.inertial.mass, float(np.linalg.eigvalsh(group.inertial.inertia)[0])
        seen = builder.inertia.of_alone(joint.name, 0) if group.light else None
        masses.append(seen or mass)
        sizes.append(seen or (mass if joint.kind == "prismatic" else least))
    return LIGHT * min(masses), LIGHT * min(sizes)
