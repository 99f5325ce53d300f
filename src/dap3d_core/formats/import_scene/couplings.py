"""Coordinates of joints that turn together: rotors, mimic joints, gearboxes, equalities."""

import numpy as np

from dap3d_core.formats.import_scene.joints import from_ground, named_ends
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.formats.import_scene.start import couples
from dap3d_core.interface.formats.articulation import Articulation, Joint
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
        rate = (*joint.rate, 0.0)[0]
        builder.scene.add_body(wheel, mass=mass, Jp=(inertia,) * 3,
                               w=(0.0, 0.0, rate) if rate else None)  # fmt: skip
        bearing = builder.names.free("joints", f"{wheel}_bearing")
        builder.scene.add_joint("rev", bearing, P_i=f"{wheel}.O", P_j="ground.O",
                                a_i=f"{wheel}.z", a_j="ground.z")  # fmt: skip
    return wheel


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
