"""A scene as an articulated model: the tree of its joints, loops, and what acts in joints."""

import numpy as np

from dap3d_core.formats.export_scene.elements import SceneElements, SceneJoint, leave_out
from dap3d_core.formats.export_scene.forces import add_forces, add_gravity
from dap3d_core.formats.export_scene.model_builder import ModelBuilder
from dap3d_core.formats.export_scene.shapes import geometries_of
from dap3d_core.interface.formats.articulation import WORLD, Articulation, Inertial, Joint, Link
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Remarks
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
    for contact in scene.contacts.values():
        leave_out(remarks, contact, "contacts of other programs yield")
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
