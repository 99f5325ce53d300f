"""A scene as an articulated model: the tree of its joints, loops, and what acts in joints."""

import numpy as np

from dap3d_core.formats.export_scene.elements import SceneElements, SceneJoint, leave_out
from dap3d_core.formats.export_scene.forces import add_forces, add_gravity
from dap3d_core.formats.export_scene.model_builder import ModelBuilder
from dap3d_core.interface.formats.articulation import (
    WORLD,
    Articulation,
    Geometry,
    Inertial,
    Joint,
    Link,
)
from dap3d_core.interface.formats.frames import Frame, axis_angle, from_quaternion, quaternion
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Remarks
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import GROUND, Scene

#: Kinds of joints whose points may be apart along the axis.
SLIDERS = ("prismatic", "cylindrical")


def articulation_of(scene: Scene, remarks: Remarks) -> Articulation:
    """The articulated model of a scene; its joints are zero in the poses of the scene.

    Args:
        scene: a valid one, without expressions.
        remarks: takes what is said in another way, and what is left out.

    Raises:
        FormatError: a joint has no counterpart, and without it the mechanism would be another.
    """
    elements = SceneElements.of(scene)
    model = Articulation(str(scene.name or "scene"), gravity=(0.0, 0.0, 0.0), fixed_base=True)
    builder = ModelBuilder(elements, remarks, model)
    tree, loops = _tree(elements)
    for body, joint in tree:
        _add_link(builder, body, joint)
        if joint is not None and joint.kind == "fixed" and joint.body_j == GROUND:
            text = f"{joint.name} holds {body} on ground: read back, {body} is a part of ground"
            remarks.translate(NOWHERE, text)
    for joint in loops:
        _add_joint(builder, joint, closes=True)
    add_gravity(builder, scene)
    add_forces(builder, scene)
    for body in elements.bodies:
        geometries = geometries_of(builder, scene, body)
        if body == GROUND and geometries:
            remarks.leave_out(NOWHERE, "shapes of ground")
        elif body in model.links:
            model.links[body].geometries = geometries
    if any(any(body.r_dot) or any(body.w) for body in scene.bodies.values()):
        remarks.leave_out(NOWHERE, "initial velocities", motion=True)
    return model


def _tree(
    elements: SceneElements,
) -> tuple[list[tuple[str, SceneJoint | None]], list[SceneJoint]]:
    """Bodies with the joint that places each, parents first, and the joints that are left."""
    left = list(elements.joints)
    tree: list[tuple[str, SceneJoint | None]] = []
    known = {GROUND}
    waiting = [name for name in elements.bodies if name != GROUND]
    while waiting:
        joint = next((j for j in left if (j.body_i in known) != (j.body_j in known)), None)
        if joint is None:  # a body without a joint to the others is free
            tree.append((waiting[0], None))
            known.add(waiting.pop(0))
            continue
        left.remove(joint)
        placed = joint if joint.body_j in known else joint.reversed()
        tree.append((placed.body_i, placed))
        known.add(placed.body_i)
        waiting.remove(placed.body_i)
    return tree, left


def _add_link(builder: ModelBuilder, body: str, joint: SceneJoint | None) -> None:
    """Add a body as a link, whose origin is that of the joint that places it."""
    mass, inertia, pose = builder.elements.bodies[body]
    origin = np.zeros(3) if joint is None else joint.on_i.r
    builder.origin[body] = origin
    builder.model.links[body] = Link(body, Inertial(mass, -origin, inertia))
    if joint is not None:
        _add_joint(builder, joint, closes=False)
        return
    name = f"{body}_free"
    position = (*pose.r.tolist(), *quaternion(pose.A))
    builder.model.joints[name] = Joint(name, "free", WORLD, body, position=position)


def _add_joint(builder: ModelBuilder, joint: SceneJoint, *, closes: bool) -> None:
    """Add a joint; its frames have the axes of body i and coincide in the poses of the scene."""
    bodies = builder.elements.bodies
    i, j = bodies[joint.body_i].pose, bodies[joint.body_j].pose
    here = Frame(joint.on_i.r)
    there = Frame(joint.on_j.r, j.A.T @ i.A)
    made = Joint(
        joint.name, joint.kind, builder.link(joint.body_j), builder.link(joint.body_i),
        builder.in_link(joint.body_j, there), builder.in_link(joint.body_i, here),
        axes=tuple(tuple(axis.tolist()) for axis in joint.axes), closes=closes,
    )  # fmt: skip
    d, slides = (j @ there).r - (i @ here).r, joint.kind in SLIDERS
    if slides:  # along the axis it is free
        axis = i.A @ joint.axes[0]
        d = d - axis * (axis @ d)
    gap = float(np.abs(d).max())
    if gap > 1e-6:
        what = f"joint {joint.name} is open by {gap:.3g} m in the poses of the scene"
        raise FormatError(what, remedy="correct them: dap3d equilibrium, or a run, has them right")
    if slides:
        made.in_parent = Frame(builder.in_link(joint.body_j, j.inverse() @ (i @ here)).r, there.A)
    builder.model.joints[joint.name] = made
    builder.placed[joint.name] = made


def geometries_of(builder: ModelBuilder, scene: Scene, body: str) -> list[Geometry]:
    """The shapes of a body; those that no model has are left out, remarked."""
    geometries = []
    for element in scene.shapes.values():
        fields = element.fields
        if fields.get("body") != body:
            continue
        color = str(fields.get("color") or "")
        color = color if color.startswith("#") and len(color) == 7 else ""
        A = from_quaternion(fields["p"]) if "p" in fields else np.eye(3)
        if "axis" in fields:
            A = turned_to(np.asarray(fields["axis"], dtype=float))
        pose = builder.in_link(body, Frame(fields.get("at", (0.0, 0.0, 0.0)), A))
        if element.type == "box":
            size = tuple(map(float, fields["size"]))
            geometries.append(Geometry("box", size, pose, color=color))
        elif element.type == "sphere":
            geometries.append(Geometry("sphere", (float(fields["radius"]),), pose, color=color))
        elif element.type == "cylinder":
            size = (float(fields["radius"]), float(fields["length"]))
            geometries.append(Geometry("cylinder", size, pose, color=color))
        elif element.type == "mesh":
            scale = (float(fields.get("scale", 1.0)),) * 3
            geometries.append(Geometry("mesh", (), pose, fields["file"], scale, color))
        else:
            leave_out(builder.remarks, element, "no shape of a model", motion=False)
    return geometries


def turned_to(axis: Floats) -> Floats:
    """The least rotation that turns the z axis to a direction."""
    x, y, z = axis / np.linalg.norm(axis)
    sine = float(np.hypot(x, y))
    if sine < 1e-14:
        return axis_angle((1.0, 0.0, 0.0), 0.0 if z > 0.0 else float(np.pi))
    return axis_angle((-y / sine, x / sine, 0.0), float(np.arctan2(sine, z)))
