"""Coordinates of joints that turn together: rotors, mimic joints, gearboxes, equalities."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dap3d_core.formats.import_scene.actuators import line_of
from dap3d_core.formats.import_scene.joints import from_ground, named_ends
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.formats.import_scene.start import AGREE, couples
from dap3d_core.interface.formats.articulation import Articulation, Joint, Tendon
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.registry.suggestions import nearest

#: Mass and inertia of a wheel that couples joints, over the least of what they move. With less,
#: methods that allow for dependent rows (lsq, joint) take the rows of two followers for one.
LIGHT = 1e-6


def add_rotor(builder: SceneBuilder, joint: Joint, inertia: float) -> None:
    """Add a wheel on ground that turns with a joint and so adds to its inertia alone."""
    text = "armature of a joint is a wheel on ground that turns with it"
    builder.remarks.translate(joint.place, text)
    wheel = wheel_of(builder, joint, 1.0, inertia)
    follow(builder, joint, wheel, 1.0, "rotor")


def wheel_of(builder: SceneBuilder, joint: Joint, mass: float, inertia: float) -> str:
    """The wheel of a joint, made if there is none yet: a body that turns about ground's z."""
    key = ("wheel", joint.name)
    wheel = builder.names.scene_names.get(key)
    if wheel is None:
        scene_name = builder.names.scene_names["joints", joint.name]
        wheel = builder.names.free("bodies", f"{scene_name}_rotor")
        builder.names.scene_names[key] = wheel
        _add_wheel(builder, wheel, mass, inertia, (*joint.rate, 0.0)[0])
    return wheel


def _add_wheel(
    builder: SceneBuilder, wheel: str, mass: float, inertia: float, rate: float = 0.0
) -> None:
    builder.scene.add_body(wheel, mass=mass, Jp=(inertia,) * 3,
                           w=(0.0, 0.0, rate) if rate else None)  # fmt: skip
    bearing = builder.names.free("joints", f"{wheel}_bearing")
    builder.scene.add_joint("rev", bearing, P_i=f"{wheel}.O", P_j="ground.O",
                            a_i=f"{wheel}.z", a_j="ground.z")  # fmt: skip


def follow(builder: SceneBuilder, joint: Joint, wheel: str, ratio: float, suffix: str) -> None:
    """Couple the coordinate of a joint with a wheel."""
    ends = named_ends(builder, from_ground(builder, joint))
    name = builder.names.free("joints", f"{ends.name}_{suffix}")
    builder.scene.add_joint(
        "follow", name, body_i=ends.child, a_j=ends.vector("j", ends.joint.axes[0], "_axis"),
        a_k=f"{wheel}.z", ratio=None if ratio == 1.0 else ratio,
        along=True if joint.kind == "prismatic" else None,
    )  # fmt: skip


def add_couplings(builder: SceneBuilder, model: Articulation) -> None:
    """Add coordinates that follow others; what cannot be coupled is left out, remarked.

    Raises:
        FormatError: a coupling names one joint twice, or one that the model does not have.
    """
    for coupling in model.couplings:
        others = model.joints.keys() - {coupling.joint}
        if coupling.joint not in model.joints or coupling.other not in others:
            near = nearest(coupling.other, others)
            what = (
                f"{coupling.joint!r} follows {coupling.other!r}: should be two joints of the file"
            )
            raise FormatError(what, coupling.place, f"did you mean {near!r}?" if near else "")
        one, other = model.joints[coupling.joint], model.joints[coupling.other]
        if one.kind == other.kind == "fixed":
            continue
        if not couples(model, coupling):
            text = f"coupling of {coupling.joint} with {coupling.other}: joints of one coordinate "
            builder.remarks.leave_out(coupling.place, f"{text}are coupled", motion=True)
            continue
        if builder.moves_alone(one) or builder.moves_alone(other):
            text = "coupling of a joint that does not move"
            builder.remarks.leave_out(coupling.place, text, motion=True)
            continue
        had_rotor = bool(other.armature[0])
        wheel = wheel_of(builder, other, *_light(builder, one, other))
        if not had_rotor and ("followed", other.name) not in builder.names.scene_names:
            builder.names.scene_names["followed", other.name] = wheel
            text = "joints are coupled by a wheel on ground, with a millionth of the inertia"
            builder.remarks.translate(coupling.place, text)
            follow(builder, other, wheel, 1.0, "rotor")
        follow(builder, one, wheel, coupling.ratio, "coupling")


def add_held(builder: SceneBuilder, model: Articulation) -> None:
    """Add links between two points, and sums of coordinates that stay as they are."""
    for tendon in model.held:
        keyword, fields = line_of(builder, model, tendon) or ("", {})
        if keyword == "ptp":
            name = builder.names.free("joints", tendon.name)
            ends = dict(zip(("P_i", "P_j"), fields["points"], strict=True))
            builder.scene.add_joint("sph-sph", name, **ends, length=tendon.rest)
        elif keyword and len(fields["movers"]) > 1:
            _hold_sum(builder, model, tendon, fields)
        else:
            text = "an equality of a tendon that moves with one joint at most"
            builder.remarks.leave_out(tendon.place, text, motion=True)


def _hold_sum(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, fields: Mapping[str, Any]
) -> None:
    """Hold a sum: wheels turn by a term, or by the sum up to there, and ground by the whole."""
    joints = [model.joints[name] for name, _ in tendon.terms if model.joints[name].kind != "fixed"]
    at_start = sum(c * (*model.joints[name].position, 0.0)[0] for name, c in tendon.terms)
    if abs(at_start - (tendon.rest or 0.0)) > AGREE:
        text = "an equality of a tendon holds the length that it has where the scene starts"
        builder.remarks.translate(tendon.place, text, motion=True)
    text = "sums of joints are held by wheels on ground, with a millionth of the inertia"
    builder.remarks.translate(tendon.place, text)
    size, names = _light(builder, *joints), builder.names
    scale = max(abs(c) for c in fields["coefs"])
    columns = [fields[key] for key in ("movers", "axes", "coefs", "slides")]
    total, count = "ground", len(fields["movers"])
    for k, (mover, axis, coef, slides) in enumerate(zip(*columns, strict=True), 1):
        wheel = names.free("bodies", f"{tendon.name}_term{k}")
        _add_wheel(builder, wheel, *size)
        builder.scene.add_joint(
            "follow", names.free("joints", f"{wheel}_follows"), body_i=mover, a_j=axis,
            a_k=f"{wheel}.z", ratio=scale / coef, along=True if slides else None,
        )  # fmt: skip
        if k == 1:
            total = wheel
            continue
        before, total = total, "ground"
        if k < count:
            total = names.free("bodies", f"{tendon.name}_sum{k}")
            _add_wheel(builder, total, *size)
        builder.scene.add_joint(
            "follow", names.free("joints", f"{tendon.name}_sum{k}"), body_i=total,
            a_j=f"{before}.z", a_k=f"{wheel}.z",
        )  # fmt: skip


def _light(builder: SceneBuilder, *joints: Joint) -> tuple[float, float]:
    """Mass and inertia of a wheel beside what joints move: beside its mass, for a slider."""
    masses, sizes = [], []
    for joint in joints:
        group = builder.groups[builder.member[from_ground(builder, joint).child][0]]
        mass, least = group.inertial.mass, float(np.linalg.eigvalsh(group.inertial.inertia)[0])
        seen = builder.inertia.of_alone(joint.name, 0) if group.light else None
        masses.append(seen or mass)
        sizes.append(seen or (mass if joint.kind == "prismatic" else least))
    return LIGHT * min(masses), LIGHT * min(sizes)
