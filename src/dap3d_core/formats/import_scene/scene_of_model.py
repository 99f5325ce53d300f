"""An articulated model as a scene: bodies, joints, and what acts on coordinates of joints."""

from collections.abc import Mapping, Sequence
from math import atan2, cos, isfinite, pi, sin
from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.import_scene import shapes
from dap3d_core.formats.import_scene.actuators import (
    NO_LIMITS,
    STOP_TIME,
    add_actuators,
    add_ball_forces,
    add_drag,
    add_held,
    add_tendons,
)
from dap3d_core.formats.import_scene.joints import (
    add_couplings,
    add_joint,
    add_rotor,
    from_ground,
    named_ends,
)
from dap3d_core.formats.import_scene.rigid_groups import STAND_IN, STEPPED, RigidGroup, rigid_groups
from dap3d_core.formats.import_scene.scene_builder import Names, SceneBuilder, float_tuple
from dap3d_core.formats.import_scene.spanning_tree import Placed, SpanningTree
from dap3d_core.formats.import_scene.start import AGREE, SCALAR, coordinate, couples, start_of
from dap3d_core.interface.formats.articulation import WORLD, Articulation, Joint, Limits, Link
from dap3d_core.interface.formats.frames import IDENTITY, Frame, quaternion
from dap3d_core.interface.formats.joint_inertia import JointInertia
from dap3d_core.interface.formats.remarks import FormatError, Remarks
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import GROUND

#: Steps of a settled result: a model does not say how long to simulate.
DURATION, STEP = 1.0, 0.01
#: Limits of joints: left out, springs with dampers, or rigid.
LIMITS = ("off", "soft", "hard")
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
    "universal": ("damping", "stiffness", "friction", "limits"),
    "ball": ("damping", "stiffness", "limits"), "free": ("damping",),
}  # fmt: skip


def _checked_limits(_: Any, __: Any, value: Any) -> None:
    if value not in LIMITS:
        raise FormatError(f"limits = {value!r}: should be one of {', '.join(LIMITS)}")


@attrs.frozen
class ImportOptions:
    """Choices of the user that a model leaves open.

    Attributes:
        free_base: links without a joint to a parent are free, where the format leaves it open.
        keep_fixed: fixed joints between moving links stay joints.
        balance_inertia: their mean replaces principal moments that no body has, not the nearest.
        limits: of joints: one of LIMITS.
        positions, rates: of joints where the scene starts, by name, as the file counts them.
        contacts: shapes meet each other.
    """

    free_base: bool = False
    keep_fixed: bool = False
    balance_inertia: bool = False
    limits: str = attrs.field(default="soft", validator=_checked_limits)
    positions: dict[str, Sequence[float]] = attrs.Factory(dict)
    rates: dict[str, Sequence[float]] = attrs.Factory(dict)
    contacts: bool = False


def scene_of(
    model: Articulation,
    remarks: Remarks,
    options: ImportOptions | None = None,
    *,
    meshes: shapes.MeshFiles | None = None,
    names: Names | None = None,
) -> Scene:
    """The scene of a model.

    Args:
        model: the model.
        remarks: takes what is translated with a difference and what is left out.
        options: choices of the user.
        meshes: takes the meshes that the shapes of the scene name.
        names: takes the names in the scene, with their places in the file.

    Raises:
        FormatError: the model is no mechanism, or holds a joint without a counterpart.
    """
    options = options or ImportOptions()
    base_fixed = _is_base_fixed(model, remarks, free_base=options.free_base)
    limited = options.limits != "off"
    model = start_of(model, options.positions, options.rates, remarks, limited=limited)
    model = split_planar(model, remarks)
    tree = SpanningTree.of(model)
    groups, member = rigid_groups(
        tree, remarks, fixed_base=base_fixed, keep_fixed=options.keep_fixed,
        balance_inertia=options.balance_inertia,
        stand_in=STEPPED if options.contacts else STAND_IN,
    )  # fmt: skip
    if len(groups) == 1:
        raise FormatError("no link of the model moves", model.place)
    for joint in tree.loops:
        if joint.name in options.positions or joint.name in options.rates:
            text = f"position or rate of {joint.name}: the joint closes a loop, the others place it"
            remarks.translate(joint.place, text, motion=True)
    placed = tree.place()
    scene = Scene(name=model.name)
    scene.simulation.t_end, scene.simulation.dt = DURATION, STEP
    if any(group.light for group in groups.values()):
        scene.simulation.method = "joint"
        text = "method joint, for links without mass or inertia: others lose digits to them"
        remarks.translate(model.place, text)
    builder = SceneBuilder(scene, remarks, groups, member, _inertia(tree, groups), options.limits,
                           names or Names())  # fmt: skip
    builder.bodies[WORLD] = GROUND
    for group in groups.values():
        if group.name != WORLD:
            _add_body(builder, group, placed[group.name])
    _add_gravity(builder, model.gravity)
    _add_joints(builder, model)
    bits = shapes.bits_of_shapes(builder, model) if options.contacts else {}
    for group in groups.values():
        for link, _ in group.links:
            shapes.add_shapes(builder, link, shapes.MeshFiles() if meshes is None else meshes, bits)
    if options.contacts:
        shapes.add_collisions(builder, model)
    return scene


def _add_joints(builder: SceneBuilder, model: Articulation) -> None:
    """Add joints, what acts in them, and what couples them."""
    for joint in model.joints.values():
        if builder.moves_alone(joint):
            continue
        if joint.kind != "free":
            add_joint(builder, joint)
        _add_joint_forces(builder, joint)
    add_couplings(builder, model)
    add_held(builder, model)
    add_actuators(builder, model)
    add_tendons(builder, model)


def _inertia(tree: SpanningTree, groups: Mapping[str, RigidGroup]) -> JointInertia:
    """The inertias that joints see: of the bodies of the scene, with loops and couplings."""
    model, placing = tree.model, dict(tree.placing)
    links = {
        name: Link(name, groups[name].inertial if name in groups else None) for name in model.links
    }
    poses = {WORLD: IDENTITY}
    for name in tree.roots:
        pose = poses[name] = model.base_poses.get(name, IDENTITY)
        if name in groups:
            placing[name] = Joint(name, "free", WORLD, name,
                                  position=(*pose.r.tolist(), *quaternion(pose.A)))  # fmt: skip
    couplings = [one for one in model.couplings if couples(model, one)]
    return JointInertia(links, placing, tree.order, couplings, tree.loops, poses)


def _is_base_fixed(model: Articulation, remarks: Remarks, *, free_base: bool) -> bool:
    """True if links without a joint to a parent are fixed to ground."""
    if model.fixed_base is not None:
        return model.fixed_base
    moves = any(joint.kind != "fixed" for joint in model.joints.values())
    if not moves and not free_base:
        remarks.translate(model.place, "no joint of the model moves: its base is free", motion=True)
    return moves and not free_base


def _add_body(builder: SceneBuilder, group: RigidGroup, placed: Placed) -> None:
    inertial = group.inertial
    arm = placed.frame.A @ inertial.com
    name = builder.names.of("bodies", group.name, group.links[0][0].place, builder.remarks)
    builder.bodies[group.name] = name
    fields: dict[str, Any] = {
        "mass": inertial.mass,
        "Jp": inertia_numbers(inertial.inertia),
        "r": float_tuple(placed.frame.r + arm),
        "p": quaternion(placed.frame.A),
    }
    velocity = placed.v + np.cross(placed.w, arm)
    if velocity.any():
        fields["r_dot"] = float_tuple(velocity)
    if placed.w.any():
        fields["w"] = float_tuple(placed.w)
    builder.scene.add_body(name, **fields)


def inertia_numbers(inertia: Floats) -> Any:
    """Three numbers for a diagonal inertia matrix, else three rows; exactly symmetric."""
    symmetric = 0.5 * (inertia + inertia.T)
    if not (symmetric - np.diag(np.diag(symmetric))).any():
        return float_tuple(np.diag(symmetric))
    return tuple(float_tuple(row) for row in symmetric)


def _add_gravity(builder: SceneBuilder, gravity: Sequence[float]) -> None:
    """Add gravity, and what carries a part of the weight of links at their mass centres."""
    size, scene = float(np.linalg.norm(gravity)), builder.scene
    if not size > 0.0:
        return
    wgt = tuple(g / size + 0.0 for g in gravity)
    scene.add_force("weight", "gravity", gravity=size, wgt=wgt)
    for group in builder.groups.values():
        for link, _ in group.links:
            if group.name != WORLD and link.gravcomp and link.inertial is not None:
                body, frame = builder.attached(link.name, Frame(link.inertial.com))
                force = float_tuple(-link.gravcomp * link.inertial.mass * np.array(gravity))
                point = builder.point_at(body, frame.r, f"{body}_carried")
                builder.add_force("f", f"{body}_carried", P_i=point, f=force)


def split_planar(model: Articulation, remarks: Remarks) -> Articulation:
    """The same model with two sliding joints and a hinge in place of each planar joint."""
    if not any(joint.kind == "planar" for joint in model.joints.values()):
        return model
    links, joints = dict(model.links), {}
    for name, joint in model.joints.items():
        if joint.kind != "planar":
            joints[name] = joint
            continue
        text = "a planar joint is two sliding joints and a hinge, with two links between"
        remarks.translate(joint.place, text)
        x, y = (np.asarray(axis, dtype=float) for axis in joint.axes)
        between = [f"{name}_{letter}" for letter in "xy"]
        for link in between:
            links[link] = Link(link, place=joint.place)
        ends = [joint.parent, *between, joint.child]
        q = joint.position or (0.0, 0.0, 0.0)
        parts = zip(("prismatic", "prismatic", "revolute"), (x, y, np.cross(x, y)), strict=True)
        for k, (kind, axis) in enumerate(parts):
            part = name if k == 2 else between[k]
            joints[part] = Joint(
                part, kind, ends[k], ends[k + 1], axes=(tuple(axis),), position=(q[k],),
                rate=joint.rate[k : k + 1], damping=joint.damping, friction=joint.friction,
                place=joint.place,
            )  # fmt: skip
        joints[between[0]].in_parent, joints[name].in_child = joint.in_parent, joint.in_child
    return attrs.evolve(model, links=links, joints=joints)


def _add_joint_forces(builder: SceneBuilder, joint: Joint) -> None:
    """Add what acts on the coordinates of a joint; what no type can say is left out, remarked."""
    given = [key for key in WORDS if any(map(_acts, getattr(joint, key)))]
    taken = TAKEN.get(joint.kind, ())
    for key in given:
        if key not in taken:
            text = f"{WORDS[key]} of a {joint.kind} joint"
            builder.remarks.leave_out(joint.place, text, motion=True)
    if not set(given) & set(taken):
        return
    if joint.kind in ("ball", "free"):
        (add_ball_forces if joint.kind == "ball" else add_drag)(builder, joint)
        return
    for k in range(len(joint.axes)):
        coordinate = _JointCoordinate(builder, joint, k)
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


class _JointCoordinate:
    """A coordinate q of a joint, an angle or a length, and the force elements on it.

    The axes of a universal joint are across each other, the first fixed in the parent and the
    second in the child: the angles about them are those of two hinges.
    """

    def __init__(self, builder: SceneBuilder, joint: Joint, k: int) -> None:
        self.builder, self.joint, self.k = builder, joint, k
        self.turns = joint.kind != "prismatic"
        # exchanged ends of a universal joint have its axes in the other order
        there = from_ground(builder, joint)
        self.ends = named_ends(builder, there)
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
            across = np.asarray(ends.joint.axes[1 - self.at]) if two else _perpendicular(axis)
            fields |= {  # of the parent against the child about the opposite axis: q
                "v_i": ends.vector("i", across, f"_across{suffix}"),
                "v_j": ends.vector("j", across, f"_across{suffix}"),
                "axis": ends.vector(self._holder(), -axis, f"_back{suffix}"),
            }
        self.builder.add_force(keyword, f"{self.name}_{what}", **fields)

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
            builder.remarks.translate(joint.place, NO_LIMITS, motion=True)
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
        q = coordinate(joint)
        if joint in builder.inertia.loops or not limits.contain(q, AGREE * max(1.0, abs(q))):
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
        self.builder.add_force("plane_stop", f"{self.name}_{side}_stop", P_i=ends.point("i"),
                               P_j=plane, a_j=normal, **fields)  # fmt: skip

    def _own_inertia(self) -> float:
        """Mass, or inertia about the axis, of the child alone, where no mass matrix has it."""
        group, _ = self.builder.member[self.ends.joint.child]
        body, axis = self.builder.groups[group].inertial, self.ends.on_child.A @ self.axis
        arm = np.cross(axis, self.ends.on_child.r)
        turning = float(axis @ body.inertia @ axis + body.mass * (arm @ arm))
        return turning if self.turns else body.mass

    def add_friction(self) -> None:
        """Add dry friction, which sticks, or fades at low rates where runs take no contacts."""
        friction, builder, ends = self._value("friction"), self.builder, self.ends
        if friction < 0.0:
            text = "friction below 0, which would drive"
            builder.remarks.leave_out(self.joint.place, text, motion=True)
        if friction <= 0.0:
            return
        fading = None if builder.takes_contacts else FADING
        if fading:
            unit = "rad/s" if self.turns else "m/s"
            text = f"dry friction of a joint fades below {fading:g} {unit}: it creeps, and does not"
            builder.remarks.translate(self.joint.place, f"{text} stick", motion=True)
        name = f"{self.name}_friction"
        if self.turns:
            axis = ends.vector(self._holder(), self.axis)
            builder.add_force("rot_friction", name, body_i=ends.child, body_j=ends.parent,
                              axis=axis, n_c=friction, w_tol=fading)  # fmt: skip
        else:
            builder.add_force("tran_friction", name, P_i=ends.point("i"), f_c=friction,
                              a_j=ends.vector("j", self.axis), v_tol=fading)  # fmt: skip


def _perpendicular(axis: Floats) -> Floats:
    """A unit vector across an axis, along a coordinate axis where that is one."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = other - (other @ axis) * axis
    return np.asarray(across / np.linalg.norm(across))
