"""Shapes: solids, lines and meshes fixed in bodies, which are drawn, and may collide."""

import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from unicodedata import normalize

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.tables import NO_TURN, ZERO, Element
from dap3d_core.scene.validate.coerce_values import (
    SHORTEST,
    Fault,
    bounded,
    number_of,
    numbers_of,
    points_of,
    quaternion_of,
    text_of,
    truth_of,
)
from dap3d_core.scene.validate.geometry import BAD, body_index_of
from dap3d_core.scene.validate.mistake_collector import Collector

#: Suffixes of mesh files.
MESHES = (".obj", ".stl", ".msh")


@attrs.frozen
class Shape:
    """A shape without mistakes.

    Attributes:
        name: its name in the scene.
        type: one of SHAPES, or a kind that a package brings.
        body: index of its body, ground 0.
        values: its other fields; those left out have their default.
    """

    name: str
    type: str
    body: int
    values: dict[str, Any]


def _edges(value: Any, *, count: int = 3, words: str = "three") -> Any:
    edges = numbers_of(value, count)
    if not isinstance(edges, Fault) and min(edges) <= 0.0:
        return Fault(f"should be {words} edges, greater than 0")
    return edges


def _axis(value: Any) -> Any:
    axis = numbers_of(value, 3)
    if not isinstance(axis, Fault) and sum(x * x for x in axis) < SHORTEST**2:
        return Fault("an axis needs a direction; its length is 0")
    return axis


def _bits(value: Any) -> Any:
    fits = type(value) is int and 0 <= value < 2**32
    return value if fits else Fault("should be a whole number from 0 to 2^32 - 1")


def _heights(value: Any) -> Any:
    rows = value if isinstance(value, tuple) else ()
    sizes = {len(row) if isinstance(row, tuple) else 0 for row in rows}
    if len(rows) < 2 or len(sizes) > 1 or min(sizes) < 2:
        return Fault("should be two or more rows of two or more heights, all as long")
    read = [numbers_of(row, len(row)) for row in rows]
    return next((row for row in read if isinstance(row, Fault)), tuple(read))


def _factors(value: Any) -> Any:
    if not isinstance(value, tuple):
        factor = _NUMBER.read(value)
        return factor if isinstance(factor, Fault) else (factor,) * 3
    factors = numbers_of(value, 3)
    return Fault("no factor is 0") if not isinstance(factors, Fault) and 0.0 in factors else factors


@attrs.frozen
class Field:
    """A field of a shape: its reader, its default (None: required), its description."""

    read: Callable[[Any], Any]
    default: Any
    doc: str


_NUMBER = Field(lambda v: bounded(number_of(v), positive=True), None, "m, greater than 0")
_AT = Field(lambda v: numbers_of(v, 3), ZERO, "centre in the axes of the body, m")
_P = Field(quaternion_of, NO_TURN, "Euler parameters of its axes in those of the body")
_AXIS = Field(_axis, (0.0, 0.0, 1.0), "direction of its axis in the body")
_COLOR = Field(text_of, "", "as of a body, whose colour it has when left out")
_ROD = {"radius": _NUMBER, "length": _NUMBER, "at": _AT, "axis": _AXIS, "color": _COLOR}
#: Fields of shapes that may meet others.
_MEETS = {
    "collides": Field(truth_of, False, "whether it meets other shapes that collide"),
    "material": Field(text_of, "", "of its surface; that of [collisions] when left out"),
    "group": Field(_bits, 1, "bits of the groups that it is in"),
    "meets": Field(_bits, 1, "bits of the groups that it meets; one of both has to"),
}

#: Type -> its fields, besides body.
SHAPES: Mapping[str, Mapping[str, Field]] = {
    "box": {"size": Field(_edges, None, "edges, 3 numbers, m"), "at": _AT,
            "p": _P, "color": _COLOR} | _MEETS,
    "ellipsoid": {"size": Field(_edges, None, "its three axes, whole, 3 numbers, m"), "at": _AT,
                  "p": _P, "color": _COLOR} | _MEETS,
    "sphere": {"radius": _NUMBER, "at": _AT, "color": _COLOR} | _MEETS,
    "capsule": _ROD | _MEETS,
    "cylinder": _ROD | _MEETS,
    "plane": {
        "at": Field(_AT.read, ZERO, "a point of it in the axes of the body, m"),
        "normal": Field(_axis, (0.0, 0.0, 1.0), "from what is solid outward, in the body"),
        "extent": Field(_NUMBER.read, 2.0, "m, edge of the square that is drawn; it has no end"),
        "color": _COLOR,
    } | _MEETS,
    "height_field": {
        "heights": Field(_heights, None, "rows along x of heights along y, m"),
        "size": Field(partial(_edges, count=2, words="two"), None, "edges along x and y, m"),
        "at": Field(_AT.read, ZERO, "below its middle, at height 0, in the body, m"),
        "p": _P,
        "color": _COLOR,
    } | _MEETS,
    "cone": {
        "radius": _NUMBER,
        "length": _NUMBER,
        "at": Field(_AT.read, ZERO, "centre of its base in the axes of the body, m"),
        "axis": Field(_axis, (0.0, 0.0, 1.0), "direction from the base to the tip"),
        "color": _COLOR,
    },
    "disk": {"radius": _NUMBER, "at": _AT, "axis": _AXIS, "color": _COLOR},
    "line": {"points": Field(points_of, None, "two or more points in the body, m"),
             "color": _COLOR},
    "mesh": {
        "file": Field(text_of, None, "an STL, OBJ or MSH (MuJoCo) file in the folder of the scene"),
        "at": Field(_AT.read, ZERO, "where the origin of the file lies in the body, m"),
        "p": _P,
        "scale": Field(_factors, (1.0, 1.0, 1.0), "m for one unit of the file; 3 numbers along its "
                       "axes, which mirror where negative"),
        "color": _COLOR,
    } | _MEETS,
}  # fmt: skip


def read_shapes(report: Collector, index: Mapping[str, int]) -> list[Shape]:
    """The shapes of a scene that are without mistakes; mistakes are reported.

    index: name of a body -> its index, ground 0.
    """
    shapes = (_shape(report, index, element) for element in report.scene.shapes.values())
    return [shape for shape in shapes if shape is not None]


def _shape(report: Collector, index: Mapping[str, int], element: Element) -> Shape | None:
    key: Key = ("shapes", element.name)
    word, given = element.type, element.fields
    body = body_index_of(report, index, (*key, "body"), given.get("body"))
    fields = SHAPES[word] if isinstance(word, str) and word in SHAPES else _added(report, element)
    if fields is None:
        return None
    allowed = ("type", "body", *fields)
    report.add_unknown_keys(key, given, allowed, in_order=True)
    readers = {name: field.read for name, field in fields.items()}
    if "file" in readers:
        readers["file"] = lambda value: _mesh_of(report.scene.folder, value)
    values = {
        name: field.default
        if name not in given and field.default is not None
        else report.read((*key, name), given.get(name, MISSING), readers[name], f" ({field.doc})")
        for name, field in fields.items()
    }
    is_good = given.keys() <= set(allowed) and body != BAD
    if not is_good or any(isinstance(value, Fault) for value in values.values()):
        return None
    return Shape(element.name, str(word), body, values)


def _added(report: Collector, element: Element) -> Mapping[str, Field] | None:
    """The fields of a kind that a package brings; None where a mistake is reported."""
    from dap3d_core.interface.errors import PluginError
    from dap3d_core.interface.fields import specs_of
    from dap3d_core.registry.extensions import extensions
    from dap3d_core.scene.validate.coerce_values import READERS

    key, word, added = ("shapes", element.name), element.type, extensions("shape")
    known = (*SHAPES, *added.keywords)
    if word is None:
        what = f"is required; one of {', '.join(known)}"
        report.add_missing_type(key, element.fields, what)
        return None
    if not isinstance(word, str) or word not in added.keywords:
        what = f"unknown shape; one of {', '.join(known)}"
        report.add((*key, "type"), word, what, nearest(word, known))
        return None
    try:
        specs = specs_of(added.load(word))
    except PluginError as error:
        report.add((*key, "type"), word, str(error))
        return None
    own = {
        name: Field(
            partial(READERS[spec.kind], spec),
            None if spec.required else spec.default,
            f"{spec.doc or name}{f', {spec.unit}' if spec.unit else ''}",
        )
        for name, spec in specs.items()
    }
    return own | {"at": _AT, "p": _P, "color": _COLOR}


def _mesh_of(folder: Path | None, value: Any) -> str | Fault:
    """The name of a mesh file that exists."""
    name = text_of(value)
    path = name if isinstance(name, Fault) else mesh_file(folder, name)
    return path if isinstance(path, Fault) else name


def height_field(values: Mapping[str, Any]) -> tuple[Floats, Integers]:
    """Vertices (k, 3), m, and triangles (m, 3), upward, of a height field, given its fields."""
    heights, (x, y) = np.array(values["heights"]), values["size"]
    nx, ny = heights.shape
    at = np.meshgrid(np.linspace(-0.5 * x, 0.5 * x, nx), np.linspace(-0.5 * y, 0.5 * y, ny),
                     indexing="ij")  # fmt: skip
    number = np.arange(nx * ny).reshape(nx, ny)
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    a, b, c, d = (part.ravel() for part in corners)
    both = np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1)
    return np.column_stack([at[0].ravel(), at[1].ravel(), heights.ravel()]), both.reshape(-1, 3)


def mesh_file(folder: Path | None, name: str) -> Path | Fault:
    """The mesh file that a scene names, or its fault.

    It must be in the folder of the scene or below, links resolved: a scene from others must not
    put the user's files into a page.

    Args:
        folder: of the scene; None where it is unknown, as of a scene that a result carries: then
            the file is not checked.
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
        if not path.exists():  # names of files are as the system gives them, decomposed on some
            decomposed = folder / normalize("NFD", name)
            path = decomposed if decomposed.exists() else path
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
