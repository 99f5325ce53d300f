"""Forces on balls and free links: springs, dampers, and stops at the greatest turn."""

import numpy as np

from dap3d_core.formats.import_scene.joints import from_ground, named_ends
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.interface.formats.articulation import Joint
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.scene.tables import GROUND

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
    name = builder.names.free("forces", f"{ends.name}_{'spring' if k else 'damper'}")
    builder.scene.add_force("sph_sd", name, body_i=ends.child, body_j=ends.parent, k=k or None,
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
    name = builder.names.free("forces", f"{ends.name}_stop")
    builder.scene.add_force("sph_stop", name, body_i=ends.parent, body_j=ends.child,
                            phi_stop=joint.limits[0].upper,
                            p_c=quaternion(ends.on_parent.A @ ends.on_child.A.T),
                            **fields)  # fmt: skip


def add_drag(builder: SceneBuilder, joint: Joint) -> None:
    """Add a damper of a free link: against its velocity at its frame, and its angular velocity."""
    body, frame = builder.attached(joint.child, Frame())
    point, names = f"{body}.O", builder.names
    if frame.r.any():
        point = names.free("points", f"{body}_drag")
        builder.scene.add_point(point, body, float_tuple(frame.r))
    builder.scene.add_force("bushing", names.free("forces", f"{body}_drag"), P_i=f"{GROUND}.O",
                            P_j=point, c=(joint.damping[0],) * 6)  # fmt: skip
