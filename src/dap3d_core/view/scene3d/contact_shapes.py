"""What contacts touch with, as shapes of their bodies."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats, Group
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
    numbers = {
        field: group.numbers[k, at : at + int(np.prod(shape))].reshape(shape)
        for field, (at, shape) in type_info.layout.numbers.items()
    }
    for slot, kind in type_info.type.surfaces.items():  # type: ignore[attr-defined]
        own = {
            field: numbers.get(f"{field}_{slot}", numbers.get(field))
            for field in ("P", "Q", "a", "radius", "length", "size", "samples", "is_closed")
        }
        for type_, values in DRAWINGS[kind](own):
            fields = {field: _plain(value) for field, value in values.items()}
            yield Shape(name, type_, bodies[slot], fields)


def _plain(value: Any) -> Any:
    value = np.asarray(value)
    if value.ndim == 2:
        return tuple(map(floats_of, value))
    return floats_of(value) if value.ndim else float(value)


Pieces = Iterator[tuple[str, dict[str, Any]]]
Own = Mapping[str, Any]


def _sphere(own: Own) -> Pieces:
    if own["radius"] > 0.0:
        yield "sphere", {"radius": own["radius"], "at": own["P"]}


def _shell(own: Own) -> Pieces:
    """Three circles: a ball may be inside."""
    s = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    circle = own["radius"] * np.stack([np.cos(s), np.sin(s), 0.0 * s])
    for turn in range(3):
        yield "line", {"points": own["P"] + np.roll(circle, turn, axis=0).T}


def _box(own: Own) -> Pieces:
    yield "box", {"size": own["size"], "at": own["P"]}


def _disk(own: Own) -> Pieces:
    yield "disk", {"radius": own["radius"], "axis": own["a"], "at": own["P"]}


def _cylinder(own: Own) -> Pieces:
    size = {field: own[field] for field in ("radius", "length")}
    yield "cylinder", {**size, "axis": own["a"], "at": own["P"]}


def _capsule(own: Own) -> Pieces:
    along: Floats = own["Q"] - own["P"]
    if own["radius"] > 0.0:
        length = float(np.linalg.norm(along))
        at = 0.5 * (own["P"] + own["Q"])
        yield "capsule", {"radius": own["radius"], "length": length, "axis": along, "at": at}


def _curve(own: Own) -> Pieces:
    """The line through the points that its type looks from; none of a curve without ends."""
    points = own["samples"][:, 1:]
    if np.ptp(points, axis=0).any():
        points = np.vstack([points, points[: int(own["is_closed"])]])
        yield "line", {"points": own["P"] + points}


#: Kind of a surface (``interface.contacts.contact.SURFACES``) -> what draws it.
DRAWINGS: dict[str, Callable[[Own], Pieces]] = {
    "sphere": _sphere,
    "shell": _shell,
    "box": _box,
    "disk": _disk,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "curve": _curve,
}
