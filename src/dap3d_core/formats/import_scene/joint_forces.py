"""What acts on the coordinates of joints: springs, dampers, stops, rotors, couplings, inputs."""

import re
from math import isfinite, pi
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.joints import JointEnds, from_ground
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.interface.formats.articulation import Articulation, Joint, Limits
from dap3d_core.interface.formats.frames import Floats
from dap3d_core.scene.scene import GROUND

#: Stiffness of stops where the format says none, N m/rad and N/m.
STOP_STIFFNESS = {"revolute": 1e4, "prismatic": 1e6}
#: Distance behind a sliding joint without limits from which a spring along its axis is drawn, m.
FAR = 1e3


def add_joint_forces(builder: SceneBuilder, joint: Joint) -> None:
    """Add what acts on the coordinates of a joint; what no type can say is left out, remarked."""
    said = [any(getattr(joint, name)) for name in ("damping", "stiffness", "friction", "armature")]
    limited = any(isfinite(one.lower) or isfinite(one.upper) for one in joint.limits)
    if not any(said) and not limited:
        return
    if joint.kind not in ("revolute", "prismatic"):
        _leave_out(builder, joint, said, limited)
        return
    coordinate = JointCoordinate(builder, joint)
    if joint.damping[0] or joint.stiffness[0]:
        coordinate.add_spring(joint.stiffness[0], joint.rest[0], joint.damping[0])
    if limited:
        coordinate.add_stops(joint.limits[0])
    if joint.friction[0]:
        text = "friction of a joint that does not depend on its load: no type of force is this"
        builder.remarks.leave_out(joint.place, text)
    if joint.armature[0]:
        _add_rotor(builder, joint, joint.armature[0])


def _leave_out(builder: SceneBuilder, joint: Joint, said: list[bool], limited: bool) -> None:
    words = ("damping", "spring", "friction", "armature", "limits")
    for word, there in zip(words, (*said, limited), strict=True):
        if there:
            builder.remarks.leave_out(joint.place, f"{word} of a {joint.kind} joint")


class JointCoordinate:
    """The coordinate of a hinge or a slider, and the force elements on it.

    That of a slider is the length of a spring along its axis, from a point far behind it on the
    parent: l = back + q.
    """

    def __init__(self, builder: SceneBuilder, joint: Joint) -> None:
        joint = from_ground(builder, joint)
        self.builder, self.joint = builder, joint
        self.ends = NamedEnds(builder, joint)
        self.turns = joint.kind == "revolute"
        finite = [abs(x) for one in joint.limits for x in (one.lower, one.upper) if isfinite(x)]
        rest = abs(joint.rest[0]) if joint.stiffness[0] else 0.0
        self.back = 0.0 if self.turns else 1.5 * max([*finite, rest, 0.01])
        if not self.turns and not all(map(isfinite, (joint.limits[0].lower,))):
            self.back = FAR

    def _element(self, kind: str) -> tuple[str, dict[str, Any]]:
        """Keyword of the type of force, and its fields that place it."""
        axis = np.asarray(self.joint.axes[0], dtype=float)
        if not self.turns:
            behind = self.ends.point("j", -self.back * axis, f"_{kind}")
            return "ptp", {"P_i": self.ends.point("i", suffix=f"_{kind}"), "P_j": behind}
        across = perpendicular(axis)
        return "rot_sda", {  # of the parent against the child about the opposite axis: q
            "v_i": self.ends.vector("i", across, "_across"),
            "v_j": self.ends.vector("j", across, "_across"),
            "axis": self.ends.vector("i", -axis, "_back"),
        }

    def add_spring(self, k: float, rest: float, c: float) -> None:
        """Add a linear spring without force at ``rest``, and a linear damper."""
        keyword, fields = self._element("spring")
        if self.turns:
            fields |= {"theta_0": rest or None, "turns": True if k else None}
        else:
            fields |= {"l0": self.back + rest} if k else {}
        name = self.builder.names.free("forces", f"{self.ends.name}_spring" if k else
                                       f"{self.ends.name}_damper")  # fmt: skip
        self.builder.scene.add_force(keyword, name, k=k or None, c=c or None, **fields)

    def add_stops(self, limits: Limits) -> None:
        """Add elastic stops at the limits."""
        builder, kind = self.builder, self.joint.kind
        stiffness = limits.stiffness or STOP_STIFFNESS[kind]
        unit = "N m/rad" if self.turns else "N/m"
        text = f"limits of a joint are elastic stops of {stiffness:g} {unit} without damping"
        builder.remarks.translate(self.joint.place, text)
        keyword, fields = self._element("stops")
        name = builder.names.free("functions", f"{self.ends.name}_stops")
        wide = max(1e6, *(abs(x) for x in (limits.lower, limits.upper) if isfinite(x)))
        builder.scene.add_function(
            "stops", name, k=stiffness,
            lower=limits.lower if isfinite(limits.lower) else -2.0 * wide,
            upper=limits.upper if isfinite(limits.upper) else 2.0 * wide,
        )  # fmt: skip
        beyond = max(abs(limits.lower), abs(limits.upper)) > 0.75 * pi
        fields |= {"turns": True if beyond else None} if self.turns else {"l0": self.back}
        force = builder.names.free("forces", f"{self.ends.name}_stops")
        builder.scene.add_force(keyword, force, function=name, **fields)
        q = builder.positions.get(self.joint.name, self.joint.position) or (0.0,)
        if not limits.lower <= q[0] <= limits.upper:
            text = f"joint {self.joint.name} starts at {q[0]:g}, beyond its limits "
            text += f"{limits.lower:g} and {limits.upper:g}: the stops push it back"
            builder.remarks.translate(self.joint.place, text)


def perpendicular(axis: Floats) -> Floats:
    """A unit vector across an axis, along a coordinate axis where that is one."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = other - (other @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))


class NamedEnds(JointEnds):
    """The ends of a joint that has its name in the scene already."""

    def __init__(self, builder: SceneBuilder, joint: Joint) -> None:
        self.builder, self.joint, self.scene = builder, joint, builder.scene
        self.child, self.on_child = builder.attached(joint.child, joint.in_child)
        self.parent, self.on_parent = builder.attached(joint.parent, joint.in_parent)
        self.name = builder.names.scene_names["joints", joint.name]


def _add_rotor(builder: SceneBuilder, joint: Joint, inertia: float) -> None:
    """Add a wheel on ground that turns with a joint and so adds to its inertia alone."""
    text = "armature of a joint is a wheel on ground that turns with it"
    builder.remarks.translate(joint.place, text)
    wheel = wheel_of(builder, joint, inertia)
    follow(builder, joint, wheel, 1.0, "rotor")


def wheel_of(builder: SceneBuilder, joint: Joint, inertia: float) -> str:
    """The wheel of a joint, made if there is none yet: a body that turns about ground's z."""
    key = ("wheel", joint.name)
    wheel = builder.names.scene_names.get(key)
    if wheel is None:
        scene_name = builder.names.scene_names["joints", joint.name]
        wheel = builder.names.free("bodies", f"{scene_name}_rotor")
        builder.names.scene_names[key] = wheel
        rate = builder.rates.get(joint.name, (0.0,))[0]
        builder.scene.add_body(wheel, mass=1.0, Jp=(inertia,) * 3,
                               w=(0.0, 0.0, rate) if rate else None)  # fmt: skip
        bearing = builder.names.free("joints", f"{wheel}_bearing")
        builder.scene.add_joint("rev", bearing, P_i=f"{wheel}.O", P_j="ground.O",
                                a_i=f"{wheel}.z", a_j="ground.z")  # fmt: skip
    return wheel


def follow(builder: SceneBuilder, joint: Joint, wheel: str, ratio: float, suffix: str) -> None:
    """Couple the coordinate of a joint with a wheel."""
    ends = NamedEnds(builder, joint)
    name = builder.names.free("joints", f"{ends.name}_{suffix}")
    builder.scene.add_joint(
        "follow", name, body_i=ends.child, a_j=ends.vector("j", joint.axes[0], "_axis"),
        a_k=f"{wheel}.z", ratio=None if ratio == 1.0 else ratio,
        along=True if joint.kind == "prismatic" else None,
    )  # fmt: skip


def add_couplings(builder: SceneBuilder, model: Articulation) -> None:
    """Add coordinates that follow others; what cannot be coupled is left out, remarked."""
    for coupling in model.couplings:
        pair = [model.joints.get(name) for name in (coupling.joint, coupling.other)]
        one, other = pair
        if one is None or other is None or {one.kind, other.kind} - {"revolute", "prismatic"}:
            text = f"coupling of {coupling.joint} with {coupling.other}: joints of one coordinate "
            builder.remarks.leave_out(coupling.place, f"{text}are coupled")
            continue
        if builder.moves_alone(one) or builder.moves_alone(other):
            builder.remarks.leave_out(coupling.place, "coupling of a joint that does not move")
            continue
        inertia = _light(builder, one, other)
        had_rotor = bool(other.armature[0])
        wheel = wheel_of(builder, other, inertia)
        if not had_rotor and ("followed", other.name) not in builder.names.scene_names:
            builder.names.scene_names["followed", other.name] = wheel
            text = "joints are coupled by a wheel on ground, with a billionth of the inertia"
            builder.remarks.translate(coupling.place, text)
            follow(builder, other, wheel, 1.0, "rotor")
        follow(builder, one, wheel, coupling.ratio, "coupling")


def _light(builder: SceneBuilder, *joints: Joint) -> float:
    """A billionth of the least moment of inertia, or mass, of what joints move."""
    sizes = []
    for joint in joints:
        inertial = builder.groups[builder.member[joint.child][0]].inertial
        least = float(np.linalg.eigvalsh(inertial.inertia)[0])
        sizes.append(inertial.mass if joint.kind == "prismatic" else least)
    return 1e-9 * min(sizes)


def add_inputs(builder: SceneBuilder, model: Articulation) -> None:
    """Add actuators as inputs, each a factor of a force or moment on both sides of a joint.

    The force of a slider acts on the line of its axis, on both bodies.
    """
    scene, names = builder.scene, builder.names
    for actuator in model.actuators:
        joint = from_ground(builder, model.joints[actuator.joint])
        if builder.moves_alone(joint):
            builder.remarks.leave_out(actuator.place, "an actuator of a joint that does not move")
            continue
        others = (scene.bodies, scene.points, scene.joints, scene.forces)
        clash = any(actuator.name in table for table in others)
        wanted = re.sub(r"\W", "_", f"{actuator.name}_input" if clash else actuator.name)
        wanted = f"input_{wanted}" if wanted[:1].isdigit() else wanted
        name = names.of("inputs", wanted, actuator.place, builder.remarks)
        scene.add_input(name, 0.0)
        ends = NamedEnds(builder, joint)
        axis = np.asarray(joint.axes[0], dtype=float)
        sides = (("i", ends.child, ends.on_child, 1.0), ("j", ends.parent, ends.on_parent, -1.0))
        for end, body, frame, sign in sides:
            if body == GROUND:
                continue
            vector = tuple((sign * actuator.gear * (frame.A @ axis) + 0.0).tolist())
            force = names.free("forces", f"{name}_{end}")
            if joint.kind == "revolute":
                scene.add_force("np", force, body_i=body, np=vector, input=name)
            else:
                scene.add_force("fp", force, P_i=ends.point(end), fp=vector, input=name)
