"""Shapes: solids, lines and meshes fixed in bodies, which are drawn and have no effect."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.scene import NO_TURN, ZERO, Element, unknown_key
from dap3d_core.scene.validate.coerce_values import Fault, bounded, number_of, numbers_of, text_of
from dap3d_core.scene.validate.geometry import missing_words
from dap3d_core.scene.validate.mistake_collector import Collector

#: Mesh files that can be read.
MESHES = (".obj", ".stl")
#: Euler parameters farther from unit length are refused; an axis below has no direction.
UNIT_TOLERANCE, SHORTEST = 1e-6, 1e-12


@attrs.frozen
class Shape:
    """A shape without mistakes.

    Attributes:
        name: as the scene calls it.
        type: one of SHAPES.
        body: index of its body, ground 0.
        values: its other fields; those left out have their default.
    """

    name: str
    type: str
    body: int
    values: dict[str, Any]


def _size(value: Any) -> Any:
    found = numbers_of(value, 3)
    if not isinstance(found, Fault) and min(found) <= 0.0:
        return Fault("should be three edges, greater than 0")
    return found


def _axis(value: Any) -> Any:
    found = numbers_of(value, 3)
    if not isinstance(found, Fault) and sum(x * x for x in found) < SHORTEST**2:
        return Fault("an axis needs a direction; its length is 0")
    return found


def _turn(value: Any) -> Any:
    found = numbers_of(value, 4)
    if isinstance(found, Fault):
        return found
    length = sum(x * x for x in found) ** 0.5
    if abs(length - 1.0) > UNIT_TOLERANCE:
        return Fault(
            f"should be four numbers e0, e1, e2, e3 of unit length (within {UNIT_TOLERANCE:g}); "
            f"the length is {length:.9g}"
        )
    return found


def _points(value: Any) -> Any:
    value, should = plain(value), "should be a list of two or more points of 3 numbers each"
    if type(value) is not tuple or len(value) < 2:
        return Fault(should)
    found = []
    for place, item in enumerate(value, 1):
        point = numbers_of(item, 3)
        if isinstance(point, Fault):
            return Fault(f"{should}; point {place} {point.what}", point.remedy)
        found.append(point)
    return tuple(found)


@attrs.frozen
class Field:
    """A field of a shape: how it is read, its default (None: required), what it is."""

    read: Callable[[Any], Any]
    default: Any
    doc: str


_NUMBER = Field(lambda v: bounded(number_of(v), positive=True), None, "m, greater than 0")
_AT = Field(lambda v: numbers_of(v, 3), ZERO, "centre in the axes of the body, m")
_P = Field(_turn, NO_TURN, "Euler parameters of its axes in those of the body")
_AXIS = Field(_axis, (0.0, 0.0, 1.0), "direction of its axis in the body")
_COLOR = Field(text_of, "", "as of a body, whose colour it has when left out")

#: Type -> its fields, besides body.
SHAPES: Mapping[str, Mapping[str, Field]] = {
    "box": {"size": Field(_size, None, "edges, 3 numbers, m"), "at": _AT, "p": _P, "color": _COLOR},
    "sphere": {"radius": _NUMBER, "at": _AT, "color": _COLOR},
    "cylinder": {"radius": _NUMBER, "length": _NUMBER, "at": _AT, "axis": _AXIS, "color": _COLOR},
    "cone": {
        "radius": _NUMBER,
        "length": _NUMBER,
        "at": Field(_AT.read, ZERO, "centre of its base in the axes of the body, m"),
        "axis": Field(_axis, (0.0, 0.0, 1.0), "direction from the base to the tip"),
        "color": _COLOR,
    },
    "disk": {"radius": _NUMBER, "at": _AT, "axis": _AXIS, "color": _COLOR},
    "line": {"points": Field(_points, None, "two or more points in the body, m"), "color": _COLOR},
    "mesh": {
        "file": Field(text_of, None, "an STL or OBJ file in the folder of the scene"),
        "at": Field(_AT.read, ZERO, "where the origin of the file lies in the body, m"),
        "p": _P,
        "scale": Field(_NUMBER.read, 1.0, "m for one unit of the file"),
        "color": _COLOR,
    },
}


def read_shapes(report: Collector, index: Mapping[str, int]) -> list[Shape]:
    """The shapes of a scene that are without mistakes; what is wrong is reported.

    Args:
        report: takes the mistakes; its scene is read.
        index: name of a body -> its index, ground 0.
    """
    found = (_shape(report, index, element) for element in report.scene.shapes.values())
    return [shape for shape in found if shape is not None]


def _shape(report: Collector, index: Mapping[str, int], element: Element) -> Shape | None:
    key = ("shapes", element.name)
    word = element.type
    fields = SHAPES.get(word) if isinstance(word, str) else None
    body = _body(report, index, key, element.fields.get("body"))
    if fields is None:
        given = MISSING if word is None else word
        what = f"{'is required' if word is None else 'unknown shape'}; one of {', '.join(SHAPES)}"
        report.add((*key, "type"), given, what, nearest(word, SHAPES))
        return None
    known, good = ("type", "body", *fields), body is not None
    for name, value in element.fields.items():
        if name not in known:
            report.add((*key, name), value, unknown_key(known), nearest(name, known))
            good = False
    values: dict[str, Any] = {}
    for name, field in fields.items():
        values[name] = value = _value(report, (*key, name), field, element.fields)
        good &= not isinstance(value, Fault)
    return Shape(element.name, str(word), body, values) if good and body is not None else None


def _body(report: Collector, index: Mapping[str, int], key: Key, name: Any) -> int | None:
    if isinstance(name, str) and name in index:
        return index[name]
    given = MISSING if name is None else name
    report.add((*key, "body"), given, *missing_words(report, "body", name, index))
    return None


def _value(report: Collector, key: Key, field: Field, given: Mapping[str, Any]) -> Any:
    """The value of a field, or a Fault that was reported."""
    name = str(key[-1])
    if name not in given:
        if field.default is not None:
            return field.default
        fault = Fault(f"is required ({field.doc})")
        report.add(key, MISSING, fault.what)
        return fault
    found = field.read(given[name])
    if name == "file" and not isinstance(found, Fault):
        path = mesh_file(report.scene.folder, found)
        found = path if isinstance(path, Fault) else found
    if isinstance(found, Fault):
        report.add(key, given[name], found.what, found.nearest, found.remedy)
    return found


def mesh_file(folder: Path | None, name: str) -> Path | Fault:
    """The mesh file that a scene names, or what is wrong with it.

    It lies in the folder of the scene or below, also after links are followed: a scene from
    elsewhere makes nobody's other files part of a page.

    Args:
        folder: of the scene; None where that is not known, as of a scene that a result carries:
            then the file is not looked for.
        name: as the scene writes it, with "/".
    """
    if Path(name).suffix.lower() not in MESHES:
        return Fault(f"should be one of {', '.join(f'*{suffix}' for suffix in MESHES)}")
    leaves = os.path.normpath(name).split(os.sep)[0] == ".." or os.path.isabs(name)
    if leaves or "\\" in name or ":" in name or not name.isprintable():
        return Fault(
            "should be a path inside the folder of the scene, such as meshes/crank.stl",
            "copy the file there",
        )
    path = (folder or Path()) / name
    if folder is None:
        return path
    try:
        if not path.resolve().is_relative_to(folder.resolve()):
            return Fault("leads out of the folder of the scene", "copy the file there")
        if path.exists() and not path.is_file():
            return Fault("is no regular file; a mesh is a file with triangles")
        if not path.is_file():
            others = sorted(p.name for p in path.parent.glob("*") if p.suffix.lower() in MESHES)
            return Fault(f"there is no file {path}", "", nearest(path.name, others))
    except RuntimeError:  # of Path.resolve, before Python 3.13
        return Fault("is a link that leads back to itself", "copy the file there")
    except OSError as error:
        return Fault(f"cannot be read: {error.strerror or error}")
    return path
