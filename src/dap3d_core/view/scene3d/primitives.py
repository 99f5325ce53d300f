"""Solids fixed in bodies, spans between two of them, packed numbers."""

import base64
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers

#: Coordinates in a body, m; a point with its body (ground 0).
Point = tuple[float, ...]
Located = tuple[int, Point]
#: Solids of unit size about their origin; axes along z. The base of a cone is at the origin.
SOLIDS = ("sphere", "cylinder", "cone", "box", "ring")
#: Groups that a user switches on and off; inertia is translucent.
LAYERS = ("bodies", "inertia", "shapes", "joints", "forces")


@attrs.frozen
class Mark:
    """A solid fixed in a body.

    Attributes:
        layer, kind: one of LAYERS, one of SOLIDS.
        body: index, ground 0.
        at: (3,) its centre in the body, m.
        size: (3,) factors along its own axes: radius, radius, length; of a box its edges.
        q: (4,) Euler parameters of its axes in the body.
        color: as a browser writes it.
        owner: name of its body, joint, force or shape.
    """

    layer: str
    kind: str
    body: int
    at: tuple[float, ...]
    size: tuple[float, ...]
    q: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    color: str = ""
    owner: str = ""


@attrs.frozen
class Span:
    """A rod, a spring or a thin line between points of two bodies; its length follows them."""

    layer: str
    kind: str
    start: Located
    end: Located
    radius: float
    color: str = ""
    owner: str = ""


def turned_to(axis: Any) -> tuple[float, ...]:
    """Euler parameters that turn z to the direction of a vector (3,)."""
    a = np.asarray(axis, dtype=float)
    length = np.linalg.norm(a)
    if not length > 0.0:
        return (1.0, 0.0, 0.0, 0.0)
    x, y, z = a / length
    if z < -1.0 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = np.sqrt(0.5 * (1.0 + z))
    return tuple(map(float, (w, -0.5 * y / w, 0.5 * x / w, 0.0)))


def rod(
    layer: str, body: int, start: Any, end: Any, radius: float, color: str = "", owner: str = ""
) -> Mark:
    """A cylinder between two points (3,) of one body."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    size = (radius, radius, length)
    return Mark(
        layer, "cylinder", body, floats_of(0.5 * (a + b)), size, turned_to(b - a), color, owner
    )


def bar(body: int, at: Any, axis: Any, radius: float, length: float) -> Mark:
    """A cylinder about a point (3,) of a body, along a direction (3,)."""
    return Mark("", "cylinder", body, floats_of(at), (radius, radius, length), turned_to(axis))


def ball(layer: str, body: int, at: Any, radius: float, color: str = "", owner: str = "") -> Mark:
    """A sphere at a point (3,) of a body."""
    size = (radius, radius, radius)
    return Mark(layer, "sphere", body, floats_of(at), size, color=color, owner=owner)


def floats_of(values: Any) -> tuple[float, ...]:
    """Numbers as a tuple of Python's floats."""
    return tuple(float(x) for x in values)


def pack(values: Floats | Integers, kind: str = "<f4") -> str:
    """Numbers as base64 text of little-endian floats ("<f4", "<f8") or integers ("<u4")."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
