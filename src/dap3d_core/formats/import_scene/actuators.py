"""Actuators of a model as inputs, with the forces that they set; tendons."""

import re
from math import isfinite
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.joints import from_ground, named_ends
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.interface.formats.articulation import Actuator, Articulation, Tendon
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.scene.tables import GROUND


def add_actuators(builder: SceneBuilder, model: Articulation) -> None:
    """Add actuators: of joints, and forces and moments on links."""
    for actuator in model.actuators:
        link = actuator.link or model.joints[actuator.joint].child
        joint = model.joints.get(actuator.joint)
        if joint is not None and (joint.kind == "fixed" or builder.moves_alone(joint)):
            text = "an actuator of a joint that does not move"
            builder.remarks.leave_out(actuator.place, text, motion=True)
        elif joint is None and builder.bodies[builder.member[link][0]] == GROUND:
            text = "an actuator on what does not move"
            builder.remarks.leave_out(actuator.place, text, motion=True)
        elif joint is None:
            _act_on_link(builder, actuator, _input(builder, actuator))
        else:
            _act_in_joint(builder, model, actuator, _input(builder, actuator))


def _input(builder: SceneBuilder, actuator: Actuator) -> str:
    """The name of the input of an actuator, which is added with its first."""
    scene, made = builder.scene, builder.names.scene_names
    if ("input", actuator.name) not in made:
        others = (scene.bodies, scene.points, scene.joints, scene.forces)
        clash = any(actuator.name in table for table in others)
        wanted = re.sub(r"\W", "_", f"{actuator.name}_input" if clash else actuator.name)
        wanted = f"input_{wanted}" if wanted[:1].isdigit() else wanted
        name = builder.names.of("inputs", wanted, actuator.place, builder.remarks)
        made["input", actuator.name] = name
        scene.add_input(name, actuator.start[1])
    return made["input", actuator.name]


def _bounds(**bounds: tuple[float, float]) -> dict[str, float]:
    """Finite bounds as fields: NAME_min and NAME_max."""
    ends = ((f"{name}_{end}", x) for name, pair in bounds.items()
            for end, x in zip(("min", "max"), pair, strict=True))  # fmt: skip
    return {name: x for name, x in ends if isfinite(x)}


def _act_in_joint(
    builder: SceneBuilder, model: Articulation, actuator: Actuator, name: str
) -> None:
    """Add what acts on both sides of a joint; the force of a slider on the line of its axis."""
    scene, names = builder.scene, builder.names
    joint = from_ground(builder, model.joints[actuator.joint])
    bounds = _bounds(control=actuator.control, force=actuator.force, activation=actuator.active)
    if bounds or actuator.activation:
        q = joint.position[0] if joint.position else 0.0  # the scene counts from where it starts
        given: dict[str, Any] = {"bias": actuator.bias - actuator.stiffness * q,
                                 "k": actuator.stiffness, "c": actuator.damping}  # fmt: skip
        if actuator.activation:
            given |= {"activation": actuator.activation, "time": actuator.time,
                      "z_0": actuator.start[0]}  # fmt: skip
        scene.add_force(
            "actuator", names.free("forces", f"{name}_force"), control=name, gain=actuator.gear,
            joint=names.scene_names["joints", joint.name], **bounds,
            **{key: value for key, value in given.items() if value},
        )  # fmt: skip
        return
    ends = named_ends(builder, joint)
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


def _act_on_link(builder: SceneBuilder, actuator: Actuator, name: str) -> None:
    """Add a force and a moment on a link, in its axes."""
    body, frame = builder.attached(actuator.link, actuator.at)
    force, moment = (frame.A @ np.array(actuator.wrench[k : k + 3]) for k in (0, 3))
    given = {"input": name} | _bounds(input=actuator.control)
    if force.any():
        point = f"{body}.O"
        if frame.r.any():
            point = builder.names.free("points", f"{name}_point")
            builder.scene.add_point(point, body, float_tuple(frame.r))
        at = builder.names.free("forces", f"{name}_force")
        builder.scene.add_force("fp", at, P_i=point, fp=float_tuple(force), **given)
    if moment.any():
        about = builder.names.free("forces", f"{name}_moment")
        builder.scene.add_force("np", about, body_i=body, np=float_tuple(moment), **given)


def add_tendons(builder: SceneBuilder, model: Articulation) -> None:
    """Add tendons: a spring and damper along points, and of two rigid stops of their distance."""
    for tendon in model.tendons:
        if len({builder.member[link][0] for link, _ in tendon.points}) == 1:
            continue
        points, two = [], len(tendon.points) == 2
        for k, (link, at) in enumerate(tendon.points):
            body, frame = builder.attached(link, Frame(at))
            name = builder.names.free("points", f"{tendon.name}_{'ij'[k] if two else k + 1}")
            points.append(builder.scene.add_point(name, body, float_tuple(frame.r)))
        if not two:
            _add_cable(builder, tendon, points)
            continue
        ends = dict(zip(("P_i", "P_j"), points, strict=True))
        if tendon.stiffness or tendon.damping:
            name = builder.names.free("forces", f"{tendon.name}_spring")
            builder.scene.add_force(
                "ptp", name, **ends, k=tendon.stiffness or None, c=tendon.damping or None,
                l0=tendon.rest or None,
            )  # fmt: skip
        _add_limits(builder, tendon, ends)


def _add_cable(builder: SceneBuilder, tendon: Tendon, points: list[str]) -> None:
    """Add a spring and damper over more than two points."""
    if tendon.limits.finite:
        text = "limits of spatial tendons over more than two sites"
        builder.remarks.leave_out(tendon.place, text, motion=True)
    if tendon.stiffness and not tendon.rest:
        text = "a spatial tendon over more than two sites, of springlength 0"
        builder.remarks.leave_out(tendon.place, text, motion=True)
    elif tendon.stiffness or tendon.damping:
        name = builder.names.free("forces", f"{tendon.name}_spring")
        builder.scene.add_force(
            "cable", name, points=tuple(points), k=tendon.stiffness, c=tendon.damping or None,
            length=tendon.rest or None,
        )  # fmt: skip


def _add_limits(builder: SceneBuilder, tendon: Tendon, ends: dict[str, str]) -> None:
    """Add rigid stops at the limits of a tendon."""
    if tendon.limits.finite and (builder.limits == "off" or not builder.takes_contacts):
        text = "limits of tendons, with limits = off or method joint"
        builder.remarks.leave_out(tendon.place, text, motion=True)
        return
    for side, bound in (("min", tendon.limits.lower), ("max", tendon.limits.upper)):
        if isfinite(bound) and bound > 0.0:
            name = builder.names.free("forces", f"{tendon.name}_{side}_stop")
            builder.scene.add_force("ptp_stop", name, **ends, side=side, l_stop=bound)
