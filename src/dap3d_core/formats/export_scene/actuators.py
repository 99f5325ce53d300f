"""Inputs of a scene that act in joints, as actuators of a model."""

import numpy as np

from dap3d_core.formats.export_scene.elements import SceneJoint
from dap3d_core.formats.export_scene.model_builder import ModelBuilder
from dap3d_core.interface.formats.articulation import Actuator
from dap3d_core.interface.formats.remarks import NOWHERE
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import GROUND, Element, Scene

#: Kind of a joint -> the type of force, in axes of its body, that acts on its coordinate.
TYPES = {"revolute": "np", "prismatic": "fp"}
#: Forces along an axis and on one line, up to this part of them, or m.
ALIGNED = 1e-9


def add_actuators(builder: ModelBuilder, scene: Scene) -> set[str]:
    """Add inputs that are factors of forces on the coordinate of one joint.

    Returns:
        the names of these forces.
    """
    taken: set[str] = set()
    for name, given in scene.inputs.items():
        users = [e for e in (*scene.forces.values(), *scene.joints.values())
                 if e.fields.get("input") == name]  # fmt: skip
        for joint in builder.elements.joints:
            gear = _gear(builder, joint, users)
            if gear:
                builder.model.actuators.append(Actuator(name, joint.name, gear))
                taken |= {element.name for element in users}
                if given.value:
                    builder.remarks.leave_out(NOWHERE, f"the value of input {name} at the start")
                break
    return taken


def _gear(builder: ModelBuilder, joint: SceneJoint, users: list[Element]) -> float:
    """Force on the coordinate of a joint for an input of 1; 0.0 if that is not what acts."""
    if joint.kind not in TYPES or builder.placed[joint.name].closes:
        return 0.0
    type_ = TYPES[joint.kind]
    acting = {_body_of(builder, e): e for e in users if e.type == type_}
    moving = [one for one in (joint, joint.reversed()) if one.body_i != GROUND]
    if len(acting) != len(users) or acting.keys() != {one.body_i for one in moving}:
        return 0.0
    forces = [np.asarray(acting[one.body_i].fields[type_], dtype=float) for one in moving]
    gear = float(forces[0] @ moving[0].axes[0])
    apart = max(np.abs(f - gear * one.axes[0]).max() for f, one in zip(forces, moving, strict=True))
    places = [_place(builder, acting[one.body_i]) for one in moving]
    pose = builder.elements.bodies[moving[0].body_i].pose
    lever = np.cross(places[-1] - places[0], pose.A @ moving[0].axes[0])
    is_off = type_ == "fp" and np.abs(lever).max() > ALIGNED
    return 0.0 if is_off or apart > ALIGNED * abs(gear) else gear


def _body_of(builder: ModelBuilder, element: Element) -> str:
    """The body on which a force acts."""
    point = element.fields.get("P_i")
    return str(element.fields["body_i"]) if point is None else builder.elements.point(point)[0]


def _place(builder: ModelBuilder, element: Element) -> Floats:
    """The point at which a force acts, in global axes."""
    body, point = _body_of(builder, element), element.fields.get("P_i")
    pose = builder.elements.bodies[body].pose
    s = np.zeros(3) if point is None else builder.elements.point(point)[1]
    return np.asarray(pose.r + pose.A @ s)
