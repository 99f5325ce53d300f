"""Inputs of a scene that act in joints, as actuators of a model."""

from math import inf

import numpy as np

from dap3d_core.formats.export_scene.elements import ALIGNED, ModelBuilder, SceneJoint
from dap3d_core.interface.formats.articulation import Actuator
from dap3d_core.interface.formats.remarks import NOWHERE
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import GROUND, Element

#: Kind of a joint -> the type of force, in axes of its body, that acts on its coordinate.
TYPES = {"revolute": "np", "prismatic": "fp"}


def add_actuators(builder: ModelBuilder, scene: Scene) -> set[str]:
    """Add inputs that are factors of forces on the coordinate of one joint, and forces actuator.

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
                bounds = _bounds(users[0], "input")
                actuator = Actuator(name, joint.name, gear, control=bounds)
                builder.model.actuators.append(actuator)
                taken |= {element.name for element in users}
                if given.value:
                    text = f"the value of input {name} at the start"
                    builder.remarks.leave_out(NOWHERE, text, motion=True)
                break
    for element in scene.forces.values():
        if element.type == "actuator" and element.fields["control"] in scene.inputs:
            moved = builder.placed.get(str(element.fields.get("joint")))
            if moved is not None and moved.kind in TYPES and not moved.closes:
                builder.model.actuators.append(_actuator(element, moved.name))
                taken.add(element.name)
    return taken


def _actuator(element: Element, joint: str) -> Actuator:
    """A force actuator of a joint, which counts its coordinate from the poses of the scene, too."""
    number = {"gain": 1.0, "time": 1.0} | {
        key: float(x) for key, x in element.fields.items() if isinstance(x, float | int)
    }
    kind = element.fields.get("activation", "none")
    return Actuator(
        str(element.fields["control"]), joint, number["gain"], bias=number.get("bias", 0.0),
        stiffness=number.get("k", 0.0), damping=number.get("c", 0.0),
        control=_bounds(element, "control"), force=_bounds(element, "force"),
        active=_bounds(element, "activation"), time=number["time"],
        activation="" if kind == "none" else str(kind),
    )  # fmt: skip


def _bounds(element: Element, name: str) -> tuple[float, float]:
    """NAME_min and NAME_max of an element, infinite where it has none."""
    low, high = (element.fields.get(f"{name}_{end}") for end in ("min", "max"))
    return -inf if low is None else float(low), inf if high is None else float(high)


def _gear(builder: ModelBuilder, joint: SceneJoint, users: list[Element]) -> float:
    """Force on the coordinate of a joint for an input of 1; 0.0 if that is not what acts."""
    if joint.kind not in TYPES or builder.placed[joint.name].closes:
        return 0.0
    type_ = TYPES[joint.kind]
    point = builder.elements.point
    acting = {point(_point_of(e))[0]: e for e in users if e.type == type_}
    moving = [one for one in (joint, joint.reversed()) if one.body_i != GROUND]
    if len({_bounds(e, "input") for e in users}) > 1:
        return 0.0
    if len(acting) != len(users) or acting.keys() != {one.body_i for one in moving}:
        return 0.0
    forces = [np.asarray(acting[one.body_i].fields[type_], dtype=float) for one in moving]
    gear = float(forces[0] @ moving[0].axes[0])
    apart = max(np.abs(f - gear * one.axes[0]).max() for f, one in zip(forces, moving, strict=True))
    if apart > ALIGNED * abs(gear):
        return 0.0
    if type_ == "fp":  # on one line
        places = [builder.elements.at(_point_of(acting[one.body_i])) for one in moving]
        axis = builder.elements.bodies[moving[0].body_i].pose.A @ moving[0].axes[0]
        if np.abs(np.cross(places[-1] - places[0], axis)).max() > ALIGNED:
            return 0.0
    return gear


def _point_of(element: Element) -> str:
    """The point at which a force acts."""
    return str(element.fields.get("P_i") or f"{element.fields['body_i']}.O")
