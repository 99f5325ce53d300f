"""A scene as an articulated model: the tree of its joints, loops, and what acts in joints."""

from collections.abc import Iterator
from math import inf
from typing import Any

import numpy as np

from dap3d_core.formats.export_scene.elements import (
    ALIGNED,
    ModelBuilder,
    SceneElements,
    SceneJoint,
    add_actuators,
    leave_out,
)
from dap3d_core.interface.formats.articulation import (
    WORLD,
    Articulation,
    Coupling,
    Geometry,
    Inertial,
    Joint,
    Limits,
    Link,
)
from dap3d_core.interface.formats.frames import Frame, axis_angle, from_quaternion, quaternion
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Remarks
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import GROUND, RELEASES, Element

#: Kinds of joints whose points may be apart along the axis.
SLIDERS = ("prismatic", "cylindrical")
#: Stops beyond this are none, rad or m.
NO_STOP = 1e6
#: Orientations that are one, up to this.
SAME = 1e-12
#: Type of dry friction -> kind of its joint, its axis, and its size.
FRICTION = {
    "rot_friction": ("revolute", "axis", "n_c"), "tran_friction": ("prismatic", "a_j", "f_c"),
}  # fmt: skip
#: Kind of a shape -> the fields of its size, and a factor: a model has semi-axes of an ellipsoid.
SIZES = {
    "box": (("size",), 1.0), "sphere": (("radius",), 1.0),
    "cylinder": (("radius", "length"), 1.0), "ellipsoid": (("size",), 0.5),
}  # fmt: skip
NO_JOINT = "no force on the coordinate of a joint"


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
    for limited in scene.joints.values():
        if limited.fields.get("e"):
            leave_out(remarks, limited, "e of the limits of a joint")
        for key in limited.fields.keys() & set(RELEASES):
            leave_out(remarks, limited, f"{key} of a joint, which holds here throughout")
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


def _tree(elements: SceneElements) -> tuple[list[tuple[str, SceneJoint | None]], list[SceneJoint]]:
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
    fields = builder.elements.scene.joints[joint.name].fields
    made.limits = (Limits(fields.get("lower", -inf), fields.get("upper", inf)),)
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
        kind = str(element.type)
        if kind == "mesh":
            scale = np.broadcast_to(fields.get("scale", 1.0), 3).astype(float).tolist()
            geometries.append(Geometry(kind, (), pose, fields["file"], tuple(scale), color))
        elif kind in SIZES:
            names, factor = SIZES[kind]
            size = factor * np.ravel([fields[name] for name in names])
            geometries.append(Geometry(kind, tuple(size.tolist()), pose, color=color))
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


def add_gravity(builder: ModelBuilder, scene: Scene) -> None:
    """Add the weights of a scene as gravity."""
    total = np.zeros(3)
    for element in scene.forces.values():
        if element.type == "weight":
            direction = np.asarray(element.fields.get("wgt", (0.0, 0.0, -1.0)), dtype=float)
            total += float(element.fields.get("gravity", 9.81)) * direction
    x, y, z = (float(g) + 0.0 for g in total)
    builder.model.gravity = (x, y, z)


def add_forces(builder: ModelBuilder, scene: Scene) -> None:
    """Add forces on coordinates of joints, and rotors; others are left out, remarked."""
    springs = {"rot_sda": _of_hinge, "tran_sda": _of_slider, "ptp": _on_line}
    taken = add_actuators(builder, scene)
    for element in scene.forces.values():
        if element.name in taken:
            continue
        if element.type == "sph_sd":
            _add_to_ball(builder, element)
        elif element.type in FRICTION:
            _add_friction(builder, element)
        elif element.type in ("rot_stop", "plane_stop"):
            _add_stop(builder, element)
        elif element.type != "weight":
            of = springs.get(str(element.type))
            found = None if of is None else of(builder, element)
            if found is None:
                leave_out(builder.remarks, element, NO_JOINT)
            else:
                _add(builder, element, *found)
    _add_rotors(builder)


def _joints_along(
    builder: ModelBuilder, kind: str, bodies: set[str], axis: str
) -> Iterator[tuple[SceneJoint, float]]:
    """The joints of two bodies with an axis, and whether the axis has their sense, 1 or -1."""
    elements = builder.elements
    on, u = elements.vector(axis)
    for joint in elements.joints:
        if joint.kind == kind and {joint.body_i, joint.body_j} == bodies:
            along = float((elements.turn(joint.body_i, on) @ u) @ joint.axes[0])
            if abs(abs(along) - 1.0) <= ALIGNED:
                yield joint, float(np.sign(along))


def _of_hinge(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a torsional spring, the sense of its angle, and the angle where q = 0."""
    elements, fields = builder.elements, element.fields
    marks = [elements.vector(fields[key]) for key in ("v_i", "v_j") if key in fields]
    i, j = [on for on, _ in marks] or [fields["body_i"], fields["body_j"]]
    found = next(_joints_along(builder, "revolute", {i, j}, fields["axis"]), None)
    if found is None:
        return None
    joint, along = found
    sense, theta = along * (-1.0 if i == joint.body_i else 1.0), 0.0
    if marks:
        on, u = elements.vector(fields["axis"])
        here, there = elements.turn(on, i) @ marks[0][1], elements.turn(on, j) @ marks[1][1]
        sine, cosine = u @ np.cross(here, there), here @ there - (here @ u) * (there @ u)
        theta = float(np.arctan2(sine, cosine))
    return builder.placed[joint.name], sense, theta


def _of_slider(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a spring along an axis, the sense of its x, and x where q = 0."""
    elements, fields = builder.elements, element.fields
    i, j = (elements.point(fields[end])[0] for end in ("P_i", "P_j"))
    found = next(_joints_along(builder, "prismatic", {i, j}, fields["a_j"]), None)
    if found is None:
        return None
    joint, along = found
    axis = elements.bodies[joint.body_i].pose.A @ joint.axes[0]
    x = -along * float(axis @ _between(builder, fields))
    return builder.placed[joint.name], along * (1.0 if i == joint.body_i else -1.0), x


def _on_line(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a spring along its axis, the sense of its length, and that where q = 0."""
    elements = builder.elements
    i, j = (elements.point(end)[0] for end in elements.ends(element.fields))
    d = _between(builder, element.fields)
    length = float(np.linalg.norm(d))
    for joint in elements.joints:
        if joint.kind == "prismatic" and {joint.body_i, joint.body_j} == {i, j} and length:
            axis = elements.bodies[joint.body_i].pose.A @ joint.axes[0]
            along = float(axis @ d) / length
            if abs(abs(along) - 1.0) <= ALIGNED and _limits(builder, element) is not None:
                sense = float(np.sign(along)) * (-1.0 if i == joint.body_i else 1.0)
                return builder.placed[joint.name], sense, length
    return None


def _between(builder: ModelBuilder, fields: dict[str, Any]) -> Floats:
    """The vector from P_i to P_j in global axes."""
    P_i, P_j = builder.elements.ends(fields)
    return builder.elements.at(P_j) - builder.elements.at(P_i)


def _add_friction(builder: ModelBuilder, element: Element) -> None:
    """Add dry friction to a hinge or a slider; how it fades is the business of other programs."""
    elements, fields = builder.elements, element.fields
    kind, axis, size = FRICTION[str(element.type)]
    if kind == "revolute":
        bodies = {str(fields["body_i"]), str(fields["body_j"])}
    else:
        bodies = {elements.point(fields["P_i"])[0], elements.vector(fields["a_j"])[0]}
    found = next(_joints_along(builder, kind, bodies, fields[axis]), None)
    if found is None:
        leave_out(builder.remarks, element, NO_JOINT)
        return
    joint = builder.placed[found[0].name]
    joint.friction = (joint.friction[0] + float(fields[size]),)


def _add_to_ball(builder: ModelBuilder, element: Element) -> None:
    """Add a spring and damper to a ball; its spring is at rest where a model starts."""
    elements, fields = builder.elements, element.fields
    i, j = str(fields["body_i"]), str(fields["body_j"])
    joint = next((one for one in elements.joints if one.kind == "ball"
                  and {one.body_i, one.body_j} == {i, j}), None)  # fmt: skip
    if joint is None:
        leave_out(builder.remarks, element, NO_JOINT)
        return
    placed, k = builder.placed[joint.name], float(fields.get("k", 0.0))
    placed.damping = (placed.damping[0] + float(fields.get("c", 0.0)),)
    rest = from_quaternion(fields.get("p_c", (1.0, 0.0, 0.0, 0.0)))
    if k and np.abs(elements.turn(i, j) - rest).max() > SAME:
        leave_out(
            builder.remarks, element, "a spring of a ball that has a moment in the pose given"
        )
    elif k:
        placed.stiffness = (placed.stiffness[0] + k,)


def _limits(builder: ModelBuilder, element: Element) -> Element | bool | None:
    """The function of stops of a force; False for none, None for another function."""
    name = element.fields.get("function")
    if name is None:
        return False
    function = builder.elements.scene.functions[name]
    return function if function.type == "stops" else None


def _add(builder: ModelBuilder, element: Element, joint: Joint, sense: float, zero: float) -> None:
    """Add a spring, damper or stops to a joint; the coordinate is sense (x - zero)."""
    fields, stops = element.fields, _limits(builder, element)
    rest = float(fields.get("theta_0", fields.get("x_0", fields.get("l0", 0.0))))
    if stops is None or fields.get("n_a") or fields.get("f_a"):
        leave_out(builder.remarks, element, "a constant force or a function on a joint")
        return
    joint.damping = (joint.damping[0] + float(fields.get("c", 0.0)),)
    if isinstance(stops, Element):
        low, high = (float(stops.fields[key]) for key in ("lower", "upper"))
        ends = sorted(sense * (rest + x - zero) if abs(x) < NO_STOP else sense * x * inf
                      for x in (low, high))  # fmt: skip
        joint.limits = (Limits(ends[0] + 0.0, ends[1] + 0.0, float(stops.fields["k"])),)
    elif fields.get("k"):
        if joint.stiffness[0]:
            leave_out(builder.remarks, element, "a second spring of a joint")
            return
        joint.stiffness = (float(fields["k"]),)
        joint.rest = (sense * (rest - zero) + 0.0,)


def _add_stop(builder: ModelBuilder, element: Element) -> None:
    """Add a stop as a limit of a joint, whose coordinate is sense (x - zero) for its x."""
    fields = element.fields
    if element.type == "rot_stop":
        found = _of_hinge(builder, element)
        at = float(fields["theta_stop"])
    else:
        found = _of_plane(builder, element)
        at = float(fields.get("radius", 0.0))
    if found is None:
        leave_out(builder.remarks, element, NO_JOINT)
        return
    joint, sense, zero = found
    bound, is_least = sense * (at - zero) + 0.0, fields.get("side", "min") == "min"
    low, high = joint.limits[0].lower, joint.limits[0].upper
    ends = (max(low, bound), high) if is_least == (sense > 0.0) else (low, min(high, bound))
    joint.limits = (Limits(*ends, float(fields["k"]) if "k" in fields else None),)


def _of_plane(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a ball at a plane, the sense of its distance, and that where q = 0."""
    fields = {"P_j": f"{GROUND}.O", "a_j": f"{GROUND}.z"} | element.fields
    if builder.elements.vector(fields["a_j"])[0] != builder.elements.point(fields["P_j"])[0]:
        return None
    return _of_slider(builder, Element(element.name, element.type, fields))


def _add_rotors(builder: ModelBuilder) -> None:
    """Add wheels as armature of the joint that turns as they do, and couplings of others."""
    for name, rotor in builder.elements.rotors.items():
        pairs: list[tuple[str, float, tuple[float, ...]]] = []
        for follower, fields in rotor.followers:
            bodies = {str(fields["body_i"]), builder.elements.vector(fields["a_j"])[0]}
            kind = "prismatic" if fields.get("along") else "revolute"
            along = _joints_along(builder, kind, bodies, fields["a_j"])
            joint = next((joint for joint, sense in along if sense > 0.0), None)
            if joint is None:
                text = f"{follower} of type follow: it follows no joint"
                builder.remarks.leave_out(NOWHERE, text, motion=True)
                continue
            ratio = float(fields.get("ratio", 1.0))
            bends = fields["bends"] if fields.get("curved") else ()
            curve = (0.0, ratio, *(b / k for k, b in enumerate(bends, 2))) if bends else ()
            pairs.append((joint.name, ratio, curve))
        place = next((k for k, (_, *law) in enumerate(pairs) if law == [1.0, ()]), None)
        if place is None:
            text = f"wheel {name}: no joint turns as it does"
            builder.remarks.leave_out(NOWHERE, text, motion=True)
            continue
        leader, *_ = pairs.pop(place)
        builder.placed[leader].armature = (rotor.inertia,)
        builder.model.couplings += [
            Coupling("", one, leader, ratio, curve=curve) for one, ratio, curve in pairs
        ]
