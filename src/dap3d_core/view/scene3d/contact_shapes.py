"""What contacts touch with, as shapes of their bodies."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dap3d_core.model import Model
from dap3d_core.model.groups import Group
from dap3d_core.scene.validate.shapes import Shape
from dap3d_core.view.scene3d.primitives import floats_of

#: Corners of the circles that show a ball others may be in.
CORNERS = 48


def contact_shapes(model: Model) -> list[Shape]:
    """The surfaces that the types of a model's contacts declare, each once."""
    found: dict[str, Shape] = {}
    for group in model.contacts:
        for k, member in enumerate(group.members):
            name, _, point = model.joint_names[int(member)].partition("#")
            if point in ("", "1"):
                for shape in _of_contact(group, k, name):
                    found.setdefault(repr((shape.type, shape.body, shape.values)), shape)
    return list(found.values())


def _of_contact(group: Group, k: int, name: str) -> Iterator[Shape]:
    type_info = group.type_info
    bodies = dict(zip(type_info.layout.slots, map(int, group.bodies[k]), strict=True))
    numbers = group.of_instance(k)
    for slot, kind in type_info.type.surfaces.items():  # type: ignore[attr-defined]
        own = {
            field: numbers.get(f"{field}_{slot}", numbers.get(field))
            for field in ("P", "Q", "a", "radius", "length", "size", "samples", "is_closed")
        }
        for type_, values in _drawn(kind, own):
            fields = {field: _plain(value) for field, value in values.items()}
            yield Shape(name, type_, bodies[slot], fields)


def _plain(value: Any) -> Any:
    value = np.asarray(value)
    if value.ndim == 2:
        return tuple(map(floats_of, value))
    return floats_of(value) if value.ndim else float(value)


def _drawn(kind: str, own: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Types of shapes and their fields that draw a surface.

    kind: one of ``interface.contacts.contact.SURFACES``.
    """
    at, axis, radius = own["P"], own["a"], own["radius"]
    match kind:
        case "sphere":
            if radius > 0.0:
                yield "sphere", {"radius": radius, "at": at}
        case "shell":  # three circles: a ball may be inside
            s = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
            circle = radius * np.stack([np.cos(s), np.sin(s), 0.0 * s])
            for turn in range(3):
                yield "line", {"points": at + np.roll(circle, turn, axis=0).T}
        case "box":
            yield "box", {"size": own["size"], "at": at}
        case "disk":
            yield "disk", {"radius": radius, "axis": axis, "at": at}
        case "cylinder":
            yield "cylinder", {"radius": radius, "length": own["length"], "axis": axis, "at": at}
        case "capsule":
            if radius > 0.0:
                along, middle = own["Q"] - at, 0.5 * (at + own["Q"])
                length = float(np.linalg.norm(along))
                yield "capsule", {"radius": radius, "length": length, "axis": along, "at": middle}
        case "curve":  # the line through the points that its type looks from
            points = own["samples"][:, 1:]
            if np.ptp(points, axis=0).any():  # a curve without ends has none
                points = np.vstack([points, points[: int(own["is_closed"])]])
                yield "line", {"points": at + points}
