"""Solids fixed in bodies, spans between two of them, packed numbers."""

import base64
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

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

#: Edges around a solid of revolution; around the tube of a ring or a spring.
AROUND, ACROSS = 24, 8
#: Turns of a spring; its straight ends, as parts of its length; radius of its wire over its own.
TURNS, END, WIRE = 7, 0.125, 0.2


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


def bar(body: int, at: Any, axis: Any, radius: float, length: float) -> Mark:
    """A cylinder about a point (3,) of a body, along a direction (3,)."""
    return Mark("", "cylinder", body, floats_of(at), (radius, radius, length), turned_to(axis))


def ball(body: int, at: Any, radius: float) -> Mark:
    """A sphere at a point (3,) of a body."""
    return Mark("", "sphere", body, floats_of(at), (radius, radius, radius))


def floats_of(values: Any) -> tuple[float, ...]:
    """Numbers as a tuple of Python's floats."""
    return tuple(float(x) for x in values)


def pack(values: Floats | Integers, kind: str = "<f4") -> str:
    """Numbers as base64 text of little-endian floats ("<f4", "<f8") or integers ("<u4")."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


class Triangles(NamedTuple):
    """Vertices (k, 3), m, and triangles (m, 3) of their indices; edges have vertices twice."""

    vertices: Floats
    triangles: Integers

    @property
    def normals(self) -> Floats:
        """(k, 3) unit normals of the vertices, means of those of their triangles by area."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        normals = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(normals, self.triangles[:, k], across)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        none = np.array([0.0, 0.0, 1.0])  # of a vertex without an area: any
        return np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), none)


@cache
def solid(kind: str) -> Triangles:
    """A solid of unit size, one of ``primitives.SOLIDS``."""
    if kind == "box":
        return _box()
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    tube = np.linspace(0.0, 2.0 * np.pi, ACROSS + 1)
    profiles: dict[str, list[Any]] = {
        "sphere": [np.column_stack([np.cos(turn), np.sin(turn)])],
        "cylinder": [[(0, -0.5), (1, -0.5)], [(1, -0.5), (1, 0.5)], [(1, 0.5), (0, 0.5)]],
        "cone": [[(0, 0), (1, 0)], [(1, 0), (0, 1)]],
        "ring": [np.column_stack([1.0 + 0.09 * np.cos(tube), 0.09 * np.sin(tube)])],
    }
    return _joined([_revolved(np.asarray(profile, dtype=float)) for profile in profiles[kind]])


def spring(slenderness: float) -> Triangles:
    """A spring of unit radius and length along z, about the origin.

    Args:
        slenderness: its length over its radius as it will be drawn, so that its wire is round.
    """
    share = np.linspace(0.0, 1.0, ACROSS * TURNS * 2 + 1)
    angle, out = 2.0 * np.pi * TURNS * share, np.minimum(1.0, 4.0 * np.minimum(share, 1.0 - share))
    z = END - 0.5 + (1.0 - 2.0 * END) * share
    coil = np.column_stack([out * np.cos(angle), out * np.sin(angle), z * slenderness])
    ends = np.array([[0.0, 0.0, -0.5 * slenderness], [0.0, 0.0, 0.5 * slenderness]])
    tube = _tube(np.vstack([ends[:1], coil, ends[1:]]), WIRE)
    return Triangles(tube.vertices / (1.0, 1.0, slenderness), tube.triangles)


def _joined(pieces: Sequence[Triangles]) -> Triangles:
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    triangles = [p.triangles + start for p, start in zip(pieces, starts, strict=False)]
    return Triangles(np.vstack([p.vertices for p in pieces]), np.vstack(triangles))


def _revolved(profile: Floats) -> Triangles:
    """A profile (k, 2) of radii and heights, turned about z; outward where it runs upwards."""
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    radius, z = profile.T
    columns = [np.column_stack([radius * np.cos(a), radius * np.sin(a), z]) for a in angle]
    return _sheet(np.array(columns))


def _tube(path: Floats, radius: float) -> Triangles:
    """A tube of a radius around a path (k, 3)."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 0.0, 1.0])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    side = np.where(length > 1e-9, side / np.where(length > 1e-9, length, 1.0), [1.0, 0.0, 0.0])
    other = np.cross(along, side)
    turn = np.linspace(0.0, 2.0 * np.pi, ACROSS + 1)[:, None, None]
    return _sheet(path + radius * (np.cos(turn) * side + np.sin(turn) * other))


def _sheet(points: Floats) -> Triangles:
    """A grid (n, k, 3) of points as triangles, without those of no area."""
    n, k = points.shape[:2]
    index = np.arange(n * k).reshape(n, k)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate(
        [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    )
    vertices = points.reshape(-1, 3)
    p, q, r = (vertices[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
    return Triangles(vertices, triangles[area > 1e-12 * area.max()])


def _box() -> Triangles:
    """A cube of unit edges; each face has vertices of its own."""
    corner = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    faces = []
    for axis in range(3):
        for side in (-0.5, 0.5):
            face = np.insert(corner, axis, side, axis=1)
            outward = np.cross(face[1] - face[0], face[2] - face[0])[axis] * side > 0.0
            faces.append(face if outward else face[::-1])
    square = np.array([[0, 1, 2], [0, 2, 3]])
    return _joined([Triangles(face, square) for face in faces])
