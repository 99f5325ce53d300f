"""Shapes of a scene as geometries of links."""

import numpy as np

from dap3d_core.formats.export_scene.elements import leave_out
from dap3d_core.formats.export_scene.model_builder import ModelBuilder
from dap3d_core.interface.formats.articulation import Geometry
from dap3d_core.interface.formats.frames import Frame, axis_angle, from_quaternion
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.scene import Scene


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
        if element.type == "box":
            size = tuple(map(float, fields["size"]))
            geometries.append(Geometry("box", size, pose, color=color))
        elif element.type == "sphere":
            geometries.append(Geometry("sphere", (float(fields["radius"]),), pose, color=color))
        elif element.type == "cylinder":
            size = (float(fields["radius"]), float(fields["length"]))
            geometries.append(Geometry("cylinder", size, pose, color=color))
        elif element.type == "mesh":
            scale = (float(fields.get("scale", 1.0)),) * 3
            geometries.append(Geometry("mesh", (), pose, fields["file"], scale, color))
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
