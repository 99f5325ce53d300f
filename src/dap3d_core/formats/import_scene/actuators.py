"""Actuators of a model as inputs, with the forces that they set; tendons, and those that hold."""

import re
from collections.abc import Mapping
from math import inf, isfinite
from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.import_scene.joints import LIGHT, add_wheel, from_ground, light, named_ends
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.formats.import_scene.start import AGREE, coordinate
from dap3d_core.interface.formats.articulation import Actuator, Articulation, Joint, Limits, Tendon
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.interface.formats.tendon_length import length_of_line, rate_of_line
from dap3d_core.scene.tables import GROUND

#: Time constant of soft stops of tendons, s.
TIME = 2e-3


def add_actuators(builder: SceneBuilder, model: Articulation) -> None:
    """Add actuators: of joints, and forces and moments on links."""
    for actuator in model.actuators:
        if actuator.tendon is not None:
            _act_on_tendon(builder, model, actuator)
            continue
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
    joint = from_ground(builder, model.joints[actuator.joint])
    bounds = _bounds(control=actuator.control, force=actuator.force, activation=actuator.active)
    if bounds or actuator.activation:
        q = coordinate(joint)  # the scene counts from where it starts
        given: dict[str, Any] = {"bias": actuator.bias - actuator.stiffness * q,
                                 "k": actuator.stiffness, "c": actuator.damping}  # fmt: skip
        if actuator.activation:
            given |= {"activation": actuator.activation, "time": actuator.time,
                      "z_0": actuator.start[0]}  # fmt: skip
        builder.add_force(
            "actuator", f"{name}_force", control=name, gain=actuator.gear,
            joint=builder.names.scene_names["joints", joint.name], **bounds,
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
        if joint.kind == "revolute":
            builder.add_force("np", f"{name}_{end}", body_i=body, np=vector, input=name)
        else:
            builder.add_force("fp", f"{name}_{end}", P_i=ends.point(end), fp=vector, input=name)


def _act_on_link(builder: SceneBuilder, actuator: Actuator, name: str) -> None:
    """Add a force and a moment on a link, in its axes."""
    body, frame = builder.attached(actuator.link, actuator.at)
    force, moment = (frame.A @ np.array(actuator.wrench[k : k + 3]) for k in (0, 3))
    given = {"input": name} | _bounds(input=actuator.control)
    if force.any():
        point = builder.point_at(body, frame.r, f"{name}_point")
        builder.add_force("fp", f"{name}_force", P_i=point, fp=float_tuple(force), **given)
    if moment.any():
        builder.add_force("np", f"{name}_moment", body_i=body, np=float_tuple(moment), **given)


def _act_on_tendon(builder: SceneBuilder, model: Articulation, actuator: Actuator) -> None:
    """Add an actuator or a muscle of a tendon, whose tension is less its force."""
    line = None if actuator.tendon is None else line_of(builder, model, actuator.tendon)
    if line is None:
        builder.remarks.leave_out(actuator.place, "an actuator of a tendon that does not move")
        return
    keyword, fields = ("tendon" if line[0] == "ptp" else line[0]), line[1]
    name = _input(builder, actuator)
    low, high = actuator.force
    given: dict[str, Any] = {
        "k": actuator.stiffness, "c": actuator.damping, "bias": -actuator.bias,
        "activation": actuator.activation, "z_0": actuator.start[0], **actuator.muscle,
    }  # fmt: skip
    if actuator.activation in ("lag", "integral"):
        given["time"] = actuator.time
    if actuator.stiffness:
        fields["length"] = 0.0
    builder.add_force(
        keyword, f"{name}_force", **fields, control=name,
        **({} if actuator.muscle else {"gain": -actuator.gear}),
        **_bounds(control=actuator.control, activation=actuator.active, tension=(-high, -low)),
        **{key: value for key, value in given.items() if value},
    )  # fmt: skip


def add_tendons(builder: SceneBuilder, model: Articulation) -> None:
    """Add springs and dampers of tendons, what they move, and stops at their limits.

    Those of two points are rigid.
    """
    for tendon in model.tendons:
        line = line_of(builder, model, tendon)
        if line is None:
            text = "springs and limits of a tendon that does not move"
            builder.remarks.leave_out(tendon.place, text)
            continue
        keyword, fields = line
        spring: dict[str, Any] = {"k": tendon.stiffness or None, "c": tendon.damping or None}
        if keyword == "ptp" and not tendon.play:
            ends = dict(zip(("P_i", "P_j"), fields["points"], strict=True))
            for side, bound in (("min", tendon.limits.lower), ("max", tendon.limits.upper)):
                if _limits(builder, tendon) and isfinite(bound) and bound > 0.0:
                    name = f"{tendon.name}_{side}_stop"
                    builder.add_force("ptp_stop", name, **ends, side=side, l_stop=bound)
            if tendon.armature:
                _add_slider(builder, model, attrs.evolve(tendon, limits=Limits()), fields)
            fields, spring["l0"] = ends, tendon.rest or None
        else:
            keyword = "tendon" if keyword == "ptp" else keyword
            if tendon.terms:
                _add_stops(builder, model, tendon, keyword, fields)
                if tendon.armature:
                    text = "armature of a sum of joints is that of a wheel that turns by it"
                    builder.remarks.translate(tendon.place, text)
                    _turn_by_sum(builder, model, tendon, fields)
            else:
                _add_slider(builder, model, tendon, fields)
            spring |= {"length": tendon.rest, "play": tendon.play or None}
        if tendon.stiffness or tendon.damping:
            builder.add_force(keyword, f"{tendon.name}_spring", **fields, **spring)


def line_of(
    builder: SceneBuilder, model: Articulation, tendon: Tendon
) -> tuple[str, dict[str, Any]] | None:
    """The keyword and the fields of the line of a tendon; "ptp" of two points; None if rigid."""
    if tendon.terms:
        return _sum_of_joints(builder, model, tendon)
    links = [link for link, _ in tendon.points] + [drum.link for drum in tendon.drums]
    if len({builder.member[link][0] for link in links}) < 2:
        return None
    names, made = builder.names, builder.names.scene_names

    def point(link: str, at: Any, suffix: str) -> str:
        body, frame = builder.attached(link, Frame(at))
        key = ("tendon", f"{body}: {float_tuple(frame.r)}")
        if key not in made:
            name = names.free("points", f"{tendon.name}_{suffix}")
            made[key] = builder.scene.add_point(name, body, float_tuple(frame.r))
        return made[key]

    two = len(tendon.points) == 2 and not tendon.drums
    points = [point(link, at, "ij"[k] if two else str(k + 1))
              for k, (link, at) in enumerate(tendon.points)]  # fmt: skip
    fields: dict[str, Any] = {"points": tuple(points)}
    if two and not tendon.divisors:
        return "ptp", fields
    if tendon.divisors:
        fields["divisors"] = tendon.divisors
    drums = tendon.ordered_drums
    if drums:
        centres = [point(drum.link, drum.at.r, f"drum{k + 1}") for k, drum in enumerate(drums)]
        fields |= {"drums": tuple(centres), "radii": tuple(drum.radius for drum in drums),
                   "after": tuple(float(drum.after) for drum in drums)}  # fmt: skip
        axes = []
        for k, drum in enumerate(drums):
            if drum.cylinder:
                body, frame = builder.attached(drum.link, drum.at)
                axis = names.free("vectors", f"{tendon.name}_axis{k + 1}")
                axes.append(builder.scene.add_vector(axis, body, float_tuple(frame.A[:, 2])))
        ways = tuple(2.0 if drum.inside else float(drum.side is not None) for drum in drums)
        if axes:
            fields["axes"] = tuple(axes)
        if any(ways):
            fields["ways"] = ways
        if 1.0 in ways:
            fields["sides"] = tuple(point(*drum.side, f"side{k + 1}") if drum.side else centre
                                    for k, (drum, centre) in
                                    enumerate(zip(drums, centres, strict=True)))  # fmt: skip
    return "tendon", fields


def _sum_of_joints(
    builder: SceneBuilder, model: Articulation, tendon: Tendon
) -> tuple[str, dict[str, Any]] | None:
    columns: list[tuple[str, str, str, float, float]] = []
    length = 0.0
    for name, factor in tendon.terms:
        joint = model.joints[name]
        length += factor * (coordinate(joint) + joint.reference)
        if joint.kind == "fixed" or builder.moves_alone(joint):
            continue
        ends = named_ends(builder, from_ground(builder, joint))
        axis = ends.vector("j", ends.joint.axes[0], "_axis")
        columns.append((ends.child, ends.parent, axis, factor, float(joint.kind == "prismatic")))
    if not columns:
        return None
    fields = dict(zip(("movers", "holders", "axes", "coefs", "slides"),
                      zip(*columns, strict=True), strict=True))  # fmt: skip
    return "joint_tendon", fields | {"x_0": length}


def _add_stops(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, keyword: str, fields: Any
) -> None:
    """Add soft stops at the limits of a tendon, critically damped, unless those of joints do."""
    limits, ends = tendon.limits, np.zeros(2)
    for name, factor in tendon.terms:
        joint = model.joints[name]
        q = np.array([joint.limits[0].lower, joint.limits[0].upper]) + joint.reference
        ends += np.sort(factor * q) if factor else 0.0
    lower, upper = (limits.lower, limits.upper)
    if tendon.terms and builder.limits != "off":
        lower = -inf if ends[0] >= lower else lower
        upper = inf if ends[1] <= upper else upper
    if lower == -inf and upper == inf:
        return
    factors: dict[str, float] = {}
    for name, factor in tendon.terms:
        factors[name] = factors.get(name, 0.0) + factor
    inertia = builder.inertia.of_sum(factors) if factors else None
    if builder.limits == "off" or inertia is None:
        text = "limits of sums of joints, with limits = off, or without inertia"
        builder.remarks.leave_out(tendon.place, text, motion=True)
        return
    text = "limits of tendons are soft stops, critically damped, of a time constant of 2 ms"
    builder.remarks.translate(tendon.place, text, motion=True)
    for side, sign, bound in (("max", 1.0, upper), ("min", -1.0, lower)):
        if isfinite(bound):  # below its least length its negative is too long
            given = {"coefs": tuple(sign * c for c in fields["coefs"]), "x_0": sign * fields["x_0"]}
            builder.add_force(
                keyword, f"{tendon.name}_{side}_stop", **(fields | given), length=sign * bound,
                k=inertia / TIME**2, c=2.0 * inertia / TIME, slack=True,
            )  # fmt: skip


def _limits(builder: SceneBuilder, tendon: Tendon) -> bool:
    """True for a tendon with rigid limits; those that cannot be are left out, remarked."""
    if not tendon.limits.finite:
        return False
    if builder.limits != "off":
        return True
    builder.remarks.leave_out(tendon.place, "limits of tendons, with limits = off", motion=True)
    return False


def _add_slider(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, fields: Mapping[str, Any]
) -> None:
    """Add a slider that moves as a tendon lengthens, with its armature and its rigid limits."""
    limits = tendon.limits if _limits(builder, tendon) else Limits()
    if not (limits.finite or tendon.armature):
        return
    text = "limits of tendons are those of a slider, with a millionth of the mass that they move"
    if tendon.armature:
        text = "armature of a tendon is the mass of a slider, with its limits"
    builder.remarks.translate(tendon.place, text)
    scene, names = builder.scene, builder.names
    links = [link for link, _ in tendon.points] + [drum.link for drum in tendon.drums]
    masses = [builder.groups[builder.member[link][0]].inertial.mass for link in links]
    slider = names.free("bodies", f"{tendon.name}_slider")
    start = length_of_line(tendon, builder.pose_of)
    if not limits.lower - AGREE <= start <= limits.upper + AGREE:
        text = "a tendon starts beyond its limits: they hold it where it starts"
        builder.remarks.translate(tendon.place, text, motion=True)
    mass = tendon.armature or LIGHT * min(mass for mass in masses if mass)
    # a rail along which it weighs nothing
    across = np.cross(np.eye(3)[np.argmin(np.abs(model.gravity))], model.gravity)
    size = np.linalg.norm(across)
    level = across / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    rate = rate_of_line(tendon, builder.pose_of, builder.motion_of)
    scene.add_body(slider, mass=mass, Jp=(mass,) * 3, r=float_tuple(start * level),
                   r_dot=float_tuple(rate * level) if rate else None)  # fmt: skip
    rail = scene.add_vector(names.free("vectors", f"{slider}_way"), "ground", float_tuple(level))
    builder.add_joint(
        "tran", f"{slider}_rail", P_i=f"{slider}.O", P_j="ground.O", a_j=rail,
        lower=min(limits.lower - start, 0.0) if limits.lower > 0.0 else None,
        upper=max(limits.upper - start, 0.0) if isfinite(limits.upper) else None,
    )  # fmt: skip
    more = {"points": (*fields["points"], "ground.O", f"{slider}.O"),
            "divisors": (*(tendon.divisors or (1.0,) * len(links))[: len(tendon.points) - 1],
                         0.0, -1.0, 1.0)}  # fmt: skip
    builder.add_joint("tendon", f"{tendon.name}_length", **{**fields, **more})


def add_held(builder: SceneBuilder, model: Articulation) -> None:
    """Add links between two points, and sums of coordinates that stay as they are."""
    for tendon in model.held:
        keyword, fields = line_of(builder, model, tendon) or ("", {})
        if keyword == "ptp":
            ends = dict(zip(("P_i", "P_j"), fields["points"], strict=True))
            builder.add_joint("sph-sph", tendon.name, **ends, length=tendon.rest)
        elif keyword == "tendon":
            builder.add_joint("tendon", tendon.name, **fields, length=tendon.rest)
        elif keyword and len(fields["movers"]) > 1:
            _hold_sum(builder, model, tendon, fields)
        else:
            text = "an equality of a tendon that moves with one joint at most"
            builder.remarks.leave_out(tendon.place, text, motion=True)


def _hold_sum(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, fields: Mapping[str, Any]
) -> None:
    at_start = sum(c * coordinate(model.joints[name]) for name, c in tendon.terms)
    if abs(at_start - (tendon.rest or 0.0)) > AGREE:
        text = "an equality of a tendon holds the length that it has where the scene starts"
        builder.remarks.translate(tendon.place, text, motion=True)
    text = "sums of joints are held by wheels on ground, with a millionth of the inertia"
    builder.remarks.translate(tendon.place, text)
    _turn_by_sum(builder, model, tendon, fields)


def _turn_by_sum(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, fields: Mapping[str, Any]
) -> None:
    """Let wheels turn by a term, or by the sum up to there, and the last one by the whole.

    That has the armature, or is ground where there is none.
    """
    moving = [
        (model.joints[name], c)
        for name, c in tendon.terms
        if model.joints[name].kind != "fixed" and not builder.moves_alone(model.joints[name])
    ]
    size, names = light(builder, *(joint for joint, _ in moving)), builder.names
    scale, rate = max(abs(c) for c in fields["coefs"]), 0.0
    whole = tendon.armature * scale**2
    columns = [fields[key] for key in ("movers", "axes", "coefs", "slides")]
    total, count = "ground", len(fields["movers"])
    for k, (mover, axis, coef, slides) in enumerate(zip(*columns, strict=True), 1):
        wheel = names.free("bodies", f"{tendon.name}_term{k}")
        speed = coef / scale * (*moving[k - 1][0].rate, 0.0)[0]
        rate += speed
        own = (size[0], whole) if count == 1 else size
        add_wheel(builder, wheel, own[0], own[1], speed)
        builder.add_joint(
            "follow", f"{wheel}_follows", body_i=mover, a_j=axis, a_k=f"{wheel}.z",
            ratio=scale / coef, along=True if slides else None,
        )  # fmt: skip
        if k == 1:
            total = wheel
            continue
        before, total = total, "ground"
        if k < count or whole:
            total = names.free("bodies", f"{tendon.name}_sum{k}")
            own = (size[0], whole) if k == count else size
            add_wheel(builder, total, own[0], own[1], rate)
        builder.add_joint("follow", f"{tendon.name}_sum{k}", body_i=total, a_j=f"{before}.z",
                          a_k=f"{wheel}.z")  # fmt: skip


#: Time constant of stops where the format says no stiffness: of soft ones, and of contact at rest
#: at hard ones, s. Critically damped, what they stop stands still within some of it.
STOP_TIME = {"soft": 2e-3, "hard": 1e-4}
#: Remark where the user leaves them out.
NO_LIMITS = "limits of joints are left out: limits = off"


def add_ball_forces(builder: SceneBuilder, joint: Joint) -> None:
    """Add a spring and damper against any turn of a ball, and a stop at its greatest."""
    if joint.limits[0].finite:
        _add_stop(builder, joint)
    if not (joint.stiffness[0] or joint.damping[0]):
        return
    ends = named_ends(builder, from_ground(builder, joint))
    k, c = joint.stiffness[0], joint.damping[0]
    rest = quaternion(ends.on_child.A @ ends.on_parent.A.T) if k else None
    name = f"{ends.name}_{'spring' if k else 'damper'}"
    builder.add_force("sph_sd", name, body_i=ends.child, body_j=ends.parent, k=k or None,
                      c=c or None, p_c=rest)  # fmt: skip


def _add_stop(builder: SceneBuilder, joint: Joint) -> None:
    """Add a stop at the greatest turn of a ball: soft, or rigid where limits are hard."""
    if builder.limits == "off":
        builder.remarks.translate(joint.place, NO_LIMITS, motion=True)
        return
    ends = named_ends(builder, from_ground(builder, joint))
    fields: dict[str, float] = {}
    text = "limits of a ball are a rigid stop: its rate ends at once, without rebound"
    if builder.limits != "hard" or not builder.takes_contacts:
        own = builder.groups[builder.member[joint.child][0]].inertial.inertia
        inertia = builder.inertia.of(joint.name) or float(np.trace(own)) / 3.0
        fields = {"k": inertia / STOP_TIME["soft"] ** 2, "J_c": inertia}
        text = "limits of a ball are a soft stop, critically damped for the inertia that it sees, "
        text += "of a time constant of 2 ms"
    builder.remarks.translate(joint.place, text, motion=True)
    builder.add_force("sph_stop", f"{ends.name}_stop", body_i=ends.parent, body_j=ends.child,
                      phi_stop=joint.limits[0].upper,
                      p_c=quaternion(ends.on_parent.A @ ends.on_child.A.T), **fields)  # fmt: skip


def add_drag(builder: SceneBuilder, joint: Joint) -> None:
    """Add a damper of a free link: against its velocity at its frame, and its angular velocity."""
    body, frame = builder.attached(joint.child, Frame())
    point = builder.point_at(body, frame.r, f"{body}_drag")
    builder.add_force("bushing", f"{body}_drag", P_i=f"{GROUND}.O", P_j=point,
                      c=(joint.damping[0],) * 6)  # fmt: skip
