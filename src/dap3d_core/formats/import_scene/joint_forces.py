"""What acts on the coordinates of joints: springs, dampers, stops, dry friction, inputs."""

from math import atan2, cos, isfinite, pi, sin
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.couplings import add_rotor
from dap3d_core.formats.import_scene.joints import NamedEnds, from_ground
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.formats.import_scene.start import AGREE, SCALAR
from dap3d_core.interface.formats.articulation import Joint, Limits
from dap3d_core.interface.formats.frames import quaternion
from dap3d_core.kernels.array_types import Floats

#: Time constant of stops where the format says no stiffness: of soft ones, and of contact at rest
#: at hard ones, s. Critically damped, what they stop stands still within some of it.
STOP_TIME = {"soft": 2e-3, "hard": 1e-4}
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
            text = f"{WORDS[key]} of a {joint.kind} joint"
            builder.remarks.leave_out(joint.place, text, motion=True)
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
        return value.finite
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

    def _add(self, what: str, keyword: str, **fields: Any) -> None:
        """Add a force on the coordinate: a spring and damper, or a stop of an angle."""
        ends, axis = self.ends, self.axis
        if not self.turns:
            fields |= {"P_i": ends.point("i"), "P_j": ends.point("j"),
                       "a_j": ends.vector("j", axis)}  # fmt: skip
        else:
            suffix = "" if self.k == 0 else f"_{self.k + 1}"
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

    def _as_counted(self, q: float) -> float:
        """A coordinate as a force counts it, whose angle begins within half a turn of zero."""
        start = self.joint.position[self.k] if self.joint.position and self.turns else 0.0
        return q - 2.0 * pi * round((start - atan2(sin(start), cos(start))) / (2.0 * pi))

    def add_spring(self) -> None:
        """Add a linear spring without force at ``rest``, and a linear damper."""
        k, c = self._value("stiffness"), self._value("damping")
        if not (k or c):
            return
        fields: dict[str, Any] = {}
        if k:
            rest = self._as_counted(self._value("rest")) or None
            fields = {"theta_0": rest, "turns": True} if self.turns else {"x_0": rest}
        keyword = "rot_sda" if self.turns else "tran_sda"
        self._add("spring" if k else "damper", keyword, k=k or None, c=c or None, **fields)

    def add_stops(self) -> None:
        """Add a stop at each limit: soft, a spring and damper; hard, where velocities end."""
        limits, builder, joint = self._value("limits"), self.builder, self.joint
        if not limits.finite:
            return
        if builder.limits == "off":
            text = "limits of joints are left out: limits = off"
            builder.remarks.translate(joint.place, text, motion=True)
            return
        if self._limit(limits):
            text = "limits of a joint are rigid: its rate ends at once, without rebound"
            builder.remarks.translate(joint.place, text, motion=True)
            return
        seen = builder.inertia
        inertia = seen.of(joint.name, self.k) or seen.of_alone(joint.name, self.k)
        inertia = inertia or self._own_inertia()
        hard, given = builder.limits == "hard" and not builder.takes_contacts, limits.stiffness
        k = inertia / STOP_TIME["hard" if hard else "soft"] ** 2 if hard or given is None else given
        text = "limits of a joint are stops at which its rate ends at once, without rebound"
        if not hard:
            text = "limits of a joint are soft stops, critically damped for the inertia that they "
            text += "see, of a time constant of 2 ms" if given is None else "see"
        builder.remarks.translate(joint.place, text, motion=True)
        fields = {"k": k, "J_c" if self.turns else "m_c": inertia}
        fields |= {"e": 0.0} if hard else {"rebound": False}
        for side, bound in (("min", limits.lower), ("max", limits.upper)):
            if isfinite(bound):
                self._add_stop(side, bound, fields)

    def _limit(self, limits: Limits) -> bool:
        """Give the joint of the scene rigid limits, if they are hard and it can have some.

        The joint counts from where it starts, which is within them but in loops: what closes one
        does not know where it starts, and others may start beyond.
        """
        builder, joint = self.builder, self.joint
        if builder.limits != "hard" or not builder.takes_contacts or joint.kind not in SCALAR:
            return False
        q = joint.position[0] if joint.position else 0.0
        slack = AGREE * max(1.0, abs(q))
        inside = limits.lower - slack <= q <= limits.upper + slack
        if joint in builder.inertia.loops or not inside:
            return False
        fields = builder.scene.joints[self.name].fields
        if isfinite(limits.lower):
            fields["lower"] = min(limits.lower - q, 0.0)
        if isfinite(limits.upper):
            fields["upper"] = max(limits.upper - q, 0.0)
        return True

    def _add_stop(self, side: str, bound: float, fields: dict[str, Any]) -> None:
        """Add the stop of one limit."""
        if self.turns:
            at = self._as_counted(bound)
            self._add(f"{side}_stop", "rot_stop", theta_stop=at, side=side, **fields)
            return
        ends, way = self.ends, 1.0 if side == "min" else -1.0
        plane = ends.point("j", bound * self.axis, f"_{side}")
        normal = ends.vector("j", way * self.axis, "" if side == "min" else "_back")
        name = self.builder.names.free("forces", f"{self.name}_{side}_stop")
        self.builder.scene.add_force("plane_stop", name, P_i=ends.point("i"), P_j=plane, a_j=normal,
                                     **fields)  # fmt: skip

    def _own_inertia(self) -> float:
        """Mass, or inertia about the axis, of the child alone, where no mass matrix has it."""
        group, _ = self.builder.member[self.ends.joint.child]
        body, axis = self.builder.groups[group].inertial, self.ends.on_child.A @ self.axis
        arm = np.cross(axis, self.ends.on_child.r)
        turning = float(axis @ body.inertia @ axis + body.mass * (arm @ arm))
        return turning if self.turns else body.mass

    def add_friction(self) -> None:
        """Add dry friction, which sticks, or fades at low rates where contacts are not events."""
        friction, builder, ends = self._value("friction"), self.builder, self.ends
        if friction < 0.0:
            text = "friction below 0, which would drive"
            builder.remarks.leave_out(self.joint.place, text, motion=True)
        if friction <= 0.0:
            return
        fading = None if builder.takes_contacts and not builder.stepped else FADING
        if fading:
            unit = "rad/s" if self.turns else "m/s"
            text = f"dry friction of a joint fades below {fading:g} {unit}: it creeps, and does not"
            builder.remarks.translate(self.joint.place, f"{text} stick", motion=True)
        name = builder.names.free("forces", f"{self.name}_friction")
        if self.turns:
            axis = ends.vector(self._holder(), self.axis)
            builder.scene.add_force("rot_friction", name, body_i=ends.child, body_j=ends.parent,
                                    axis=axis, n_c=friction, w_tol=fading)  # fmt: skip
        else:
            builder.scene.add_force("tran_friction", name, P_i=ends.point("i"), f_c=friction,
                                    a_j=ends.vector("j", self.axis), v_tol=fading)  # fmt: skip


def perpendicular(axis: Floats) -> Floats:
    """A unit vector across an axis, along a coordinate axis where that is one."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = other - (other @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))
