"""The stick figure of a result: lines from the mass centre of each body to its points."""

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import count, pairwise
from typing import Any

import attrs
import numpy as np
from matplotlib.colors import is_color_like, to_hex, to_rgb

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import euler_rates, to_global
from dap3d_core.model.state_layout import split
from dap3d_core.plot.film.projection import Camera
from dap3d_core.plot.style import MARKERS, PALETTE
from dap3d_core.result import Result, ResultError
from dap3d_core.result.post.smooth_parts import cubic
from dap3d_core.scene import Scene
from dap3d_core.scene.validate.shapes import Shape
from dap3d_core.view.scene3d.contact_shapes import contact_shapes
from dap3d_core.view.scene3d.scene_data import scene_of
from dap3d_core.view.scene3d.shapes import GROUND_COLOR, parts_of, scene_shapes

#: Usual names of colours -> the shade of that hue in which colour-blind readers can tell it apart.
SHADES = {
    "blue": "#0072B2", "orange": "#E69F00", "green": "#009E73", "red": "#D55E00",
    "purple": "#4B0082", "magenta": "#CC79A7", "pink": "#CC79A7", "cyan": "#56B4E9",
    "gray": "#606060", "grey": "#606060", "brown": "#6B4423", "olive": "#C2C25A",
    "yellow": "#E69F00", "black": "#000000",
    "b": "#0072B2", "g": "#009E73", "r": "#D55E00", "c": "#56B4E9", "m": "#CC79A7",
    "y": "#E69F00", "k": "#000000",
}  # fmt: skip
#: Corners of the circle of a disk; its radius where a scene gives none, m, as its type has it.
SIDES, RADIUS = 32, 1.0
#: Numbers of coordinates that are computed at once.
BLOCK = 1_000_000
#: Shapes of more triangles are not drawn in films, whose every picture draws all of them; and in
#: snapshots. Large triangles are divided as long as there are fewer than the first in all.
MOST_TRIANGLES, MOST_IN_SNAPSHOTS = 30_000, 400_000
#: Longer edges, as parts of the largest shape, are divided: the middle of a large triangle says
#: little of what it hides.
LONGEST = 0.12
#: The darkest face of a shape, as a fraction of its colour; obliqueness of the light.
DARKEST, OBLIQUE = 0.55, (0.3, 0.5)


def _placed(body: Integers, local: Floats, r: Floats, p: Floats) -> Floats:
    """Positions (..., k, 3), m, of places in bodies at poses r (..., n, 3), p (..., n, 4)."""
    out = np.empty((*r.shape[:-2], len(body), 3))
    moving = body > 0
    b = body[moving] - 1
    out[..., ~moving, :] = local[~moving]
    out[..., moving, :] = r[..., b, :] + to_global(p[..., b, :], local[moving])
    return out


@attrs.frozen(eq=False)
class Sticks:
    """Points on bodies that are drawn of a result: first the n mass centres.

    Attributes:
        names, colors, markers: of the bodies; what tells one from the others twice over.
        body: (k,) body of each place, 1 to n, 0 for ground.
        local: (k, 3) its coordinates there, m.
        points: places of the points that belong to bodies.
        anchors: places of points of the ground.
        springs, links: (q, 2) pairs of places: ends of force elements; points that joints couple.
        rims: (q, 2) pairs of places: the circles of disks that roll, each with a spoke.
        shapes: of the scene, in place of the lines and markers of their bodies; None without.
        limits: (3, 2) of the axes as the scene gives them, m, or None.
    """

    names: tuple[str, ...]
    colors: tuple[str, ...]
    markers: tuple[str, ...]
    body: Integers
    local: Floats
    points: Integers
    anchors: Integers
    springs: Integers
    links: Integers
    rims: Integers
    shapes: "Shapes | None"
    limits: Floats | None

    @property
    def lines(self) -> Integers:
        """(q, 2) pairs of places: from mass centres to the points of their bodies; the rims."""
        spokes = np.stack([self.body[self.points] - 1, self.points], axis=1)
        return np.concatenate([spokes, self.rims])

    def positions(self, r: Floats, p: Floats) -> Floats:
        """Positions (..., k, 3), m, of all places at poses r (..., n, 3), p (..., n, 4)."""
        return _placed(self.body, self.local, r, p)

    @property
    def _framed(self) -> "Sticks":
        """The same with places where the shapes end."""
        if self.shapes is None:
            return self
        ends = self.shapes.corners
        body = np.concatenate([self.body, self.shapes.body[ends]])
        return attrs.evolve(self, body=body, local=np.vstack([self.local, self.shapes.local[ends]]))

    def extent(self, result: Result, directions: Floats, about: int | None = None) -> Floats:
        """(d, 2) least and largest of all places over the reported instants, m.

        Args:
            result: whose motion.
            directions: (3, d) unit vectors along which they are measured.
            about: body, from 0, from whose mass centre those of bodies are measured.
        """
        found = []
        framed = self._framed
        step = max(1, BLOCK // (3 * len(framed.body)))
        for start in range(0, len(result.t), step):
            r, p, _, _ = split(result.u[start : start + step])
            places = framed.positions(r, p)
            if about is not None:
                places = places[:, framed.body > 0] - r[:, [about]]
            all_of_them = places.reshape(-1, 3) @ directions
            found.append([all_of_them.min(axis=0), all_of_them.max(axis=0)])
        return np.stack([np.min(found, axis=(0, 1)), np.max(found, axis=(0, 1))], axis=1)


def sticks_of(
    result: Result, model: str | os.PathLike[str] | None = None, *, still: bool = False
) -> Sticks:
    """The stick figure of a result, from its points and from the scene in it.

    Args:
        result: whose.
        model: in whose folder meshes of shapes lie, where they are drawn.
        still: for one picture, which may take longer than each of many.
    """
    summary = result.summary
    scene = scene_of(result, model)
    n = summary.body_count
    body = [*range(1, n + 1), *(int(b) for b in summary.point_body)]
    local = [*np.zeros((n, 3)), *summary.point_local]
    place = {f"{name}.O": k for k, name in enumerate(summary.body_names)}
    place |= {name: n + k for k, name in enumerate(summary.point_names)}
    pairs = {kind: list(_ends(scene, kind)) for kind in ("forces", "joints")}
    for name in {end for found in pairs.values() for pair in found for end in pair} - set(place):
        if name == "ground.O":
            place[name] = len(body)
            body.append(0)
            local.append(np.zeros(3))
    springs, links = (_places(pairs[kind], place) for kind in ("forces", "joints"))
    pairs_of_bodies = [(body[a], body[b]) for a, b in links if body[a] and body[b]]
    colors = _colors(scene, summary.body_names, pairs_of_bodies)
    shapes = None
    surfaces = _surfaces(result) if scene.contacts else []
    if scene.shapes or surfaces:
        names = summary.body_names
        shapes = shapes_of(scene, names, [*map(to_hex, colors)], surfaces, still=still)
        colors = tuple(shapes.hues.get(k, color) for k, color in enumerate(colors, 1))
    found, shaped = np.array(body), [] if shapes is None else [*shapes.hues]
    bare = np.isin(found, shaped, invert=True)
    wheels = [(k, R) for k, R in _wheels(scene, summary.body_names) if k not in shaped]
    rims = []  # a spoke from each centre, and the sides of the circle
    for first, (k, _) in zip(count(len(body), SIDES), wheels, strict=False):
        rims += [(k - 1, first), *((first + n, first + (n + 1) % SIDES) for n in range(SIDES))]
    around = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    circle = np.stack([np.cos(around), 0.0 * around, np.sin(around)], axis=1)
    return Sticks(
        names=summary.body_names,
        colors=colors,
        markers=tuple(MARKERS[k % len(MARKERS)] for k in range(n)),
        body=np.array([*body, *(k for k, _ in wheels for _ in circle)]),
        local=np.vstack([np.reshape(local, (-1, 3)), *(R * circle for _, R in wheels)]),
        points=np.flatnonzero((found > 0) & (np.arange(len(found)) >= n) & bare),
        anchors=np.flatnonzero(found == 0),
        springs=springs,
        links=links,
        rims=np.array(rims, dtype=np.int64).reshape(-1, 2),
        shapes=shapes,
        limits=_limits(scene.animation.limits),
    )


def _surfaces(result: Result) -> list[Shape]:
    """What contacts touch with; nothing where the types of the scene are not at hand."""
    try:
        return contact_shapes(result.model)
    except ResultError:
        return []


def _limits(given: Any) -> Floats | None:
    """Limits of the axes (3, 2), m; None where there are none that make sense."""
    try:
        found = np.array(given, dtype=float)
    except (TypeError, ValueError):
        return None
    return found if found.shape == (3, 2) and np.isfinite(found).all() else None


def _ends(scene: Scene, kind: str) -> Iterator[tuple[str, str]]:
    """Names of the two points of each element that has two, given as such or by a vector.

    Of a list of ``points``, such as a cable's, each with the next.
    """
    for element in getattr(scene, kind).values():
        fields, d = element.fields, element.fields.get("d")
        ends = fields.get("P_i"), fields.get("P_j")
        if isinstance(d, str) and d in scene.vectors2:
            ends = scene.vectors2[d].P_i, scene.vectors2[d].P_j
        P_i, P_j = ends
        if isinstance(P_i, str) and isinstance(P_j, str):
            yield P_i, P_j
        listed = fields.get("points", ())
        if isinstance(listed, list | tuple) and all(isinstance(one, str) for one in listed):
            yield from pairwise(listed)


def _wheels(scene: Scene, names: Sequence[str]) -> Iterator[tuple[int, float]]:
    """Bodies that joints of the type ``disk`` roll, and their radii, m."""
    for element in scene.joints.values():
        body, radius = element.fields.get("body_i"), element.fields.get("radius", RADIUS)
        is_size = isinstance(radius, int | float) and 0.0 < radius < np.inf
        if element.type == "disk" and body in names and is_size:
            yield names.index(body) + 1, float(radius)


def _places(pairs: Sequence[tuple[str, str]], place: Mapping[str, int]) -> Integers:
    found = [(place[a], place[b]) for a, b in pairs if a in place and b in place]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _colors(
    scene: Scene, names: Sequence[str], joined: Sequence[tuple[int, int]]
) -> tuple[str, ...]:
    """The scene's colours, usual names in shades of the palette; the palette in turn elsewhere.

    Of more bodies than it has colours those of a chain of joints have one hue, as in pages.
    """
    found = []
    for name in names:
        given: Any = scene.bodies[name].color
        shade = SHADES.get(str(given).removeprefix("tab:"), given)
        found.append(shade if is_color_like(shade) else "")
    if len(names) <= len(PALETTE):
        return tuple(color or PALETTE[k] for k, color in enumerate(found))
    from dap3d_core.view.scene3d.colors import colors

    return tuple(colors([color and to_hex(color) for color in found], joined))


def pose_at(result: Result, t: float) -> tuple[Floats, Floats]:
    """Poses r (n, 3), p (n, 4) of all bodies at a time, s, between reported instants as well.

    There they are interpolated by cubics from positions and velocities at both instants; bodies
    stay rigid.
    """
    times = result.t
    k = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, max(0, len(times) - 2)))
    r, p, rd, w = split(result.u[k : k + 2])
    if len(times) < 2:
        return r[0], p[0]
    h = float(times[k + 1] - times[k])
    a = min(max((t - float(times[k])) / h, 0.0), 1.0)
    turned = cubic(a, h, p, euler_rates(p, w))
    return cubic(a, h, r, rd), turned / np.linalg.norm(turned, axis=-1, keepdims=True)


@attrs.frozen(eq=False)
class Shapes:
    """Triangles fixed in bodies.

    Attributes:
        body: (k,) body of each vertex, 0 for ground.
        local: (k, 3) vertices in the axes of the body, m.
        triangles: (q, 3) indices of vertices.
        colors: (q, 3) red, green, blue from 0 to 1.
        hues: index of a body that has a shape -> colour of its first one.
        notes: shapes that are not drawn, and why.
    """

    body: Integers
    local: Floats
    triangles: Integers
    colors: Floats
    hues: dict[int, str]
    notes: tuple[str, ...]

    @property
    def corners(self) -> Integers:
        """Indices of vertices that bound the shapes of each body, for the frame of the picture."""
        ends = [np.zeros(0, dtype=np.int64)]
        for k in np.unique(self.body):
            index = np.flatnonzero(self.body == k)
            local = self.local[index]
            ends += [index[local.argmin(axis=0)], index[local.argmax(axis=0)]]
        return np.unique(np.concatenate(ends))

    def seen(self, r: Floats, p: Floats, camera: Camera) -> tuple[Floats, Floats]:
        """Triangles (q, 3, 2) in the picture, from back to front, and their colours (q, 3)."""
        corners = _placed(self.body, self.local, r, p)[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        light = camera.towards + OBLIQUE[0] * camera.right + OBLIQUE[1] * camera.up
        bright = np.abs(normal @ (light / np.linalg.norm(light))) / np.where(length, length, 1.0)
        order = np.argsort(camera.depth(corners).mean(axis=1), kind="stable")
        shade = DARKEST + (1.0 - DARKEST) * bright[order, None]
        return camera.project(corners[order]), self.colors[order] * shade


def shapes_of(
    scene: Scene, names: Sequence[str], colors: Sequence[str], surfaces: Sequence[Shape] = (),
    *, still: bool = False,
) -> Shapes:  # fmt: skip
    """The shapes of a scene; arguments as of ``view.scene3d.shapes.scene_shapes``.

    Of too many triangles nothing is drawn, with a note; ``still``, for one picture, allows more.
    """
    most = MOST_IN_SNAPSHOTS if still else MOST_TRIANGLES
    shapes = scene_shapes(scene, names, colors, surfaces)
    notes = list(shapes.notes)
    parts = [(part, part.vertices) for part in parts_of(shapes.marks, shapes.meshes)]
    size = max((float(np.max(np.ptp(local, axis=0))) for _, local in parts), default=0.0)
    used = sum(len(part.form.triangles) for part, _ in parts)
    room = min(max(MOST_TRIANGLES - used, MOST_TRIANGLES * still), most - used)
    large = [_edges(local[part.form.triangles]).max(initial=0.0) > LONGEST * size
             for part, local in parts]  # fmt: skip
    pieces = []
    for done, (part, local) in enumerate(parts):
        extra = room // max(1, sum(large[done:]))
        pieces.append((part.body, *_divided(local, part.form.triangles, size, extra), part.color))
        room -= len(pieces[-1][2]) - len(part.form.triangles)
    for line in shapes.lines:  # triangles without an area, whose edges are visible
        k = np.arange(len(line.points) - 1)
        pieces.append((line.body, line.vertices, np.stack([k, k + 1, k + 1], axis=1), line.color))
    if sum(len(piece[2]) for piece in pieces) > most:
        notes.append(
            f"shapes of more than {most} triangles in all are not drawn; dap3d view and "
            "dap3d export show them" + (", and snapshots" if most < MOST_IN_SNAPSHOTS else "")
        )
        pieces = []
    hues = {
        piece[0]: to_hex(_rgb(piece[3])) for piece in reversed(pieces) if piece[0] in shapes.bodies
    }
    none = np.zeros((0, 3))
    bodies, locals_, triangles, colors = zip((0, none, none, GROUND_COLOR), *pieces, strict=True)
    counts = [len(local) for local in locals_]
    starts = np.repeat(np.cumsum([0, *counts[:-1]]), [len(t) for t in triangles])
    return Shapes(
        body=np.repeat(bodies, counts).astype(np.int64),
        local=np.concatenate(locals_),
        triangles=np.concatenate(triangles).astype(np.int64) + starts[:, None],
        colors=np.repeat([_rgb(color) for color in colors], [len(t) for t in triangles], axis=0),
        hues=hues,
        notes=tuple(notes),
    )


def _rgb(color: str) -> tuple[float, float, float]:
    """Red, green, blue of a colour; grey for a word that is none."""
    return to_rgb(color) if is_color_like(color) else to_rgb(GROUND_COLOR)


def _edges(corners: Floats) -> Floats:
    """Lengths (q, 3) of the edges of triangles (q, 3, 3)."""
    return np.asarray(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2))


def _divided(
    local: Floats, triangles: Integers, size: float, extra: int
) -> tuple[Floats, Integers]:
    """Triangles with short edges: long ones are divided into four, repeatedly.

    There are at most ``extra`` more than before.
    """
    most = len(triangles) + extra
    corners = local[triangles]
    for _ in range(4):
        long = _edges(corners).max(axis=1) > LONGEST * size
        if not long.any() or 3 * long.sum() + len(corners) > most:
            break
        a, b, c = corners[long].swapaxes(0, 1)
        d, e, f = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        four = [np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))]
        corners = np.concatenate([corners[~long], *four])
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
