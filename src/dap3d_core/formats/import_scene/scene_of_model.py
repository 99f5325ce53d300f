"""An articulated model as a scene."""

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.import_scene.actuators import add_actuators
from dap3d_core.formats.import_scene.couplings import add_couplings
from dap3d_core.formats.import_scene.joint_forces import add_joint_forces
from dap3d_core.formats.import_scene.joints import add_joint
from dap3d_core.formats.import_scene.names import Names
from dap3d_core.formats.import_scene.rigid_groups import (
    STAND_IN,
    STEPPED,
    RigidGroup,
    rigid_groups,
)
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.formats.import_scene.shapes import (
    MeshFiles,
    add_collisions,
    add_shapes,
    bits_of_shapes,
)
from dap3d_core.formats.import_scene.spanning_tree import Placed, SpanningTree
from dap3d_core.formats.import_scene.start import couples, start_of
from dap3d_core.interface.formats.articulation import WORLD, Articulation, Joint, Link
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


def _checked_limits(_: Any, __: Any, value: Any) -> None:
    if value not in LIMITS:
        raise FormatError(f"limits = {value!r}: should be one of {', '.join(LIMITS)}")


@attrs.frozen
class ImportOptions:
    """Choices of the user that a model leaves open.

    Attributes:
        free_base: links without a joint to a parent are free, where the format leaves it open.
        keep_fixed: fixed joints between moving links stay joints.
        balance_inertia: principal moments that no body has are replaced by their mean.
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
    meshes: MeshFiles | None = None,
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
                           options.contacts, names or Names())  # fmt: skip
    builder.bodies[WORLD] = GROUND
    for group in groups.values():
        if group.name != WORLD:
            _add_body(builder, group, placed[group.name])
    _add_gravity(builder, model.gravity)
    _add_joints(builder, model)
    bits = bits_of_shapes(builder, model) if options.contacts else {}
    for group in groups.values():
        for link, _ in group.links:
            add_shapes(builder, link, MeshFiles() if meshes is None else meshes, bits)
    if options.contacts:
        add_collisions(builder, model)
    return scene


def _add_joints(builder: SceneBuilder, model: Articulation) -> None:
    """Add joints, what acts in them, and what couples them."""
    for joint in model.joints.values():
        if builder.moves_alone(joint):
            continue
        if joint.kind != "free":
            add_joint(builder, joint)
        add_joint_forces(builder, joint)
    add_couplings(builder, model)
    add_actuators(builder, model)


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
        text = "no joint of the model moves: its base is free"
        remarks.translate(model.place, text, motion=True)
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
                point, name = f"{body}.O", builder.names.free("forces", f"{body}_carried")
                if np.abs(frame.r).max() > 0.0:
                    point = builder.names.free("points", f"{body}_carried")
                    scene.add_point(point, body, float_tuple(frame.r))
                scene.add_force("f", name, P_i=point, f=force)


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
