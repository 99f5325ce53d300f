"""What acts on the coordinates of joints: springs, dampers, stops, dry friction, inputs."""

import re
from math import isfinite, pi
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.couplings import add_rotor
from dap3d_core.formats.import_scene.joints import NamedEnds, from_ground
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.interface.formats.articulation import Articulation, Joint, Limits
from dap3d_core.interface.formats.frames import quaternion
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import GROUND

#: Stiffness of stops where the format says none, N m/rad and N/m.
STOP_STIFFNESS = {True: 1e4, False: 1e6}
#: Rate below which dry friction fades, rad/s and m/s.
FADING = 1e-2
#: What may act on each coordinate of a joint -> its name in a remark.
WORDS = {
    "damping": "damping", "stiffness": "spring", "friction": "friction", "armature": "armature",
    "limits": "limits",
}  # fmt: skip
#: Kind of a joint -> what is taken of it.
TAKEN = {
    "revolute": tuple(WORDS), "prismatic": tuple(WORDS),
    "universal": ("damping", "stiffness", "friction", "limits"), "ball": ("damping", "stiffness"),
}  # fmt: skip


def add_joint_forces(builder: SceneBuilder, joint: Joint) -> None:
    """Add what acts on the coordinates of a joint; what no type can say is left out, remarked."""
    given = [key for key in WORDS if any(map(_acts, getattr(joint, key)))]
    taken = TAKEN.get(joint.kind, ())
    for key in given:
        if key not in taken:
            builder.remarks.leave_out(joint.place, f"{WORDS[key]} of a {joint.kind} joint")
    if not set(given) & set(taken):
        return
    if joint.kind == "ball":
        _add_ball_spring(builder, joint)
        return
    for k in range(len(joint.axes)):
        coordinate = JointCoordinate(builder, joint, k)
        coordinate.add_spring()
        coordinate.add_stops()
        coordinate.add_friction()
    if "armature" in given and "armature" in taken:
        add_rotor(builder, joint, joint.armature[0])


def _acts(value: float | Limits) -> bool:
    """True for a number but zero, or a finite limit."""
    if isinstance(value, Limits):
        return isfinite(value.lower) or isfinite(value.upper)
    return bool(value)


def _add_ball_spring(builder: SceneBuilder, joint: Joint) -> None:
    """Add a spring and damper against any turn of a ball."""
    ends = NamedEnds(builder, from_ground(builder, joint))
    k, c = joint.stiffness[0], joint.damping[0]
    rest = quaternion(ends.on_child.A @ ends.on_parent.A.T) if k else None
    name = builder.names.free("forces", f"{ends.name}_{'spring' if k else 'damper'}")
    builder.scene.add_force("sph_sd", name, body_i=ends.child, body_j=ends.parent, k=k or None,
                            c=c or None, p_c=rest)  # fmt: skip


class JointCoordinate:
    """A coordinate q of a joint, an angle or a length, and the force elements on it.

    The axes of a universal joint are across each other, the first fixed in the parent and the
    second in the child: the angles about them are those of two hinges.
    """

    def __init__(self, builder: SceneBuilder, joint: Joint, k: int) -> None:
        self.builder, self.joint, self.k = builder, joint, k
        self.turns = joint.kind != "prismatic"
        # exchanged ends of a universal joint have its axes in the other order
        there = from_ground(builder, joint)
        self.ends = NamedEnds(builder, there)
        self.at = k if there is joint else len(joint.axes) - 1 - k
        self.axis = np.asarray(there.axes[self.at], dtype=float)
        self.name = self.ends.name if len(joint.axes) == 1 else f"{self.ends.name}_{k + 1}"

    def _value(self, key: str) -> Any:
        """One of what acts on this coordinate; zero, or no limits, where the model says none."""
        values = getattr(self.joint, key)
        return values[self.k] if self.k < len(values) else Limits() if key == "limits" else 0.0

    def _add(self, what: str, **fields: Any) -> None:
        """Add a spring, damper and stops on the coordinate."""
        ends, axis = self.ends, self.axis
        if not self.turns:
            keyword = "tran_sda"
            fields |= {"P_i": ends.point("i"), "P_j": ends.point("j"),
                       "a_j": ends.vector("j", axis)}  # fmt: skip
        else:
            keyword, suffix = "rot_sda", "" if self.k == 0 else f"_{self.k + 1}"
            two = len(self.joint.axes) == 2
            across = np.asarray(ends.joint.axes[1 - self.at]) if two else perpendicular(axis)
            fields |= {  # of the parent against the child about the opposite axis: q
                "v_i": ends.vector("i", across, f"_across{suffix}"),
                "v_j": ends.vector("j", across, f"_across{suffix}"),
                "axis": ends.vector(self._holder(), -axis, f"_back{suffix}"),
            }
        name = self.builder.names.free("forces", f"{self.name}_{what}")
        self.builder.scene.add_force(keyword, name, **fields)

    def _holder(self) -> str:
        """The end that the axis is fixed in: the child, but for the first of a universal joint."""
        return "j" if len(self.joint.axes) == 2 and self.at == 0 else "i"

    def add_spring(self) -> None:
        """Add a linear spring without force at ``rest``, and a linear damper."""
        k, c = self._value("stiffness"), self._value("damping")
        if not (k or c):
            return
        fields: dict[str, Any] = {}
        if k:
            rest = self._value("rest") or None
            fields = {"theta_0": rest, "turns": True} if self.turns else {"x_0": rest}
        self._add("spring" if k else "damper", k=k or None, c=c or None, **fields)

    def add_stops(self) -> None:
        """Add elastic stops at the limits."""
        limits, builder, joint = self._value("limits"), self.builder, self.joint
        if not _acts(limits):
            return
        stiffness = limits.stiffness or STOP_STIFFNESS[self.turns]
        unit = "N m/rad" if self.turns else "N/m"
        text = f"limits of a joint are elastic stops of {stiffness:g} {unit} without damping"
        builder.remarks.translate(joint.place, text)
        name = builder.names.free("functions", f"{self.name}_stops")
        wide = max(1e6, *(abs(x) for x in (limits.lower, limits.upper) if isfinite(x)))
        builder.scene.add_function(
            "stops", name, k=stiffness,
            lower=limits.lower if isfinite(limits.lower) else -2.0 * wide,
            upper=limits.upper if isfinite(limits.upper) else 2.0 * wide,
        )  # fmt: skip
        beyond = self.turns and max(abs(limits.lower), abs(limits.upper)) > 0.75 * pi
        self._add("stops", function=name, **({"turns": True} if beyond else {}))
        q = builder.positions.get(joint.name, joint.position) or (0.0,) * len(joint.axes)
        if not limits.lower <= q[self.k] <= limits.upper:
            text = f"joint {joint.name} starts at {q[self.k]:g}, beyond its limits "
            text += f"{limits.lower:g} and {limits.upper:g}: the stops push it back"
            builder.remarks.translate(joint.place, text)

    def add_friction(self) -> None:
        """Add dry friction, which fades at low rates."""
        friction, builder, ends = self._value("friction"), self.builder, self.ends
        if friction < 0.0:
            builder.remarks.leave_out(self.joint.place, "friction below 0, which would drive")
        if friction <= 0.0:
            return
        unit = "rad/s" if self.turns else "m/s"
        text = (
            f"dry friction of a joint fades below {FADING:g} {unit}: it creeps, and does not stick"
        )
        builder.remarks.translate(self.joint.place, text)
        name = builder.names.free("forces", f"{self.name}_friction")
        if self.turns:
            axis = ends.vector(self._holder(), self.axis)
            builder.scene.add_force("rot_friction", name, body_i=ends.child, body_j=ends.parent,
                                    axis=axis, n_c=friction, w_tol=FADING)  # fmt: skip
        else:
            builder.scene.add_force("tran_friction", name, P_i=ends.point("i"), f_c=friction,
                                    a_j=ends.vector("j", self.axis), v_tol=FADING)  # fmt: skip


def perpendicular(axis: Floats) -> Floats:
    """A unit vector across an axis, along a coordinate axis where that is one."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = other - (other @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))


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
