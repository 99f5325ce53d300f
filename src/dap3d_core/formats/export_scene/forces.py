"""Forces of a scene as springs, dampers, limits and rotors of the joints of a model."""

from math import inf
from typing import Any

import numpy as np

from dap3d_core.formats.export_scene.elements import SceneJoint, leave_out
from dap3d_core.formats.export_scene.model_builder import ModelBuilder
from dap3d_core.interface.formats.articulation import Coupling, Joint, Limits
from dap3d_core.interface.formats.remarks import NOWHERE
from dap3d_core.scene.scene import Element, Scene

#: Stops beyond this are none, rad or m.
NO_STOP = 1e6
#: Parallel axes and points on a line, up to this.
ALIGNED = 1e-9


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
    for element in scene.forces.values():
        if element.type == "weight":
            continue
        found = None
        if element.type == "rot_sda":
            found = _of_hinge(builder, element)
        elif element.type == "ptp":
            found = _of_slider(builder, element)
        if found is None:
            leave_out(builder.remarks, element, "no force on the coordinate of a joint")
        else:
            _add(builder, element, *found)
    _add_rotors(builder)


def _of_hinge(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a torsional spring, the sense of its angle, and the angle where q = 0."""
    elements, fields = builder.elements, element.fields
    (i, v_i), (j, v_j) = (elements.vector(fields[key]) for key in ("v_i", "v_j"))
    on, u = elements.vector(fields["axis"])
    for joint in elements.joints:
        if joint.kind != "revolute" or {joint.body_i, joint.body_j} != {i, j}:
            continue
        axis = elements.turn(joint.body_i, on) @ u
        along = float(axis @ joint.axes[0])
        if abs(abs(along) - 1.0) > ALIGNED:
            continue
        here = elements.turn(on, i) @ v_i
        there = elements.turn(on, j) @ v_j
        theta = float(
            np.arctan2(u @ np.cross(here, there), here @ there - (here @ u) * (there @ u))
        )
        sense = float(np.sign(along)) * (-1.0 if i == joint.body_i else 1.0)
        return builder.placed[joint.name], sense, theta
    return None


def _of_slider(builder: ModelBuilder, element: Element) -> tuple[Joint, float, float] | None:
    """The joint of a spring along its axis, the sense of its length, and that where q = 0."""
    elements = builder.elements
    (i, r_i), (j, r_j) = (elements.point(end) for end in elements.ends(element.fields))
    pose_i, pose_j = elements.bodies[i].pose, elements.bodies[j].pose
    d = pose_j.r + pose_j.A @ r_j - pose_i.r - pose_i.A @ r_i
    length = float(np.linalg.norm(d))
    for joint in elements.joints:
        if joint.kind == "prismatic" and {joint.body_i, joint.body_j} == {i, j} and length:
            axis = elements.bodies[joint.body_i].pose.A @ joint.axes[0]
            along = float(axis @ d) / length
            if abs(abs(along) - 1.0) <= ALIGNED and _limits(builder, element) is not None:
                sense = float(np.sign(along)) * (-1.0 if i == joint.body_i else 1.0)
                return builder.placed[joint.name], sense, length
    return None


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
    rest = float(fields.get("theta_0", fields.get("l0", 0.0)))
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


def _add_rotors(builder: ModelBuilder) -> None:
    """Add wheels as armature of the joint that turns as they do, and couplings of others."""
    for name, rotor in builder.elements.rotors.items():
        pairs: list[tuple[str, float]] = []
        for follower, fields in rotor.followers:
            joint = _followed(builder, fields)
            if joint is None:
                builder.remarks.leave_out(
                    NOWHERE, f"{follower} of type follow: it follows no joint"
                )
                continue
            pairs.append((joint.name, float(fields.get("ratio", 1.0))))
        leader = next((one for one, ratio in pairs if ratio == 1.0), None)
        if leader is None:
            builder.remarks.leave_out(NOWHERE, f"wheel {name}: no joint turns as it does")
            continue
        builder.placed[leader].armature = (rotor.inertia,)
        first = True
        for one, ratio in pairs:
            if one == leader and first:
                first = False
                continue
            builder.model.couplings.append(Coupling("", one, leader, ratio))


def _followed(builder: ModelBuilder, fields: dict[str, Any]) -> SceneJoint | None:
    """The joint whose coordinate a follower couples."""
    elements = builder.elements
    on, axis = elements.vector(fields["a_j"])
    kind = "prismatic" if fields.get("along") else "revolute"
    for joint in elements.joints:
        ends = {joint.body_i, joint.body_j}
        if joint.kind == kind and ends == {str(fields["body_i"]), on}:
            along = float((elements.turn(joint.body_i, on) @ axis) @ joint.axes[0])
            if abs(along - 1.0) <= ALIGNED:
                return joint
    return None
