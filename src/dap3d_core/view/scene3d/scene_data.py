"""Solids that show a result: bodies, shapes, joints, forces, ground; and the camera."""

import os
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.fields import slot_of
from dap3d_core.interface.formats.frames import quaternion
from dap3d_core.model.groups import Floats
from dap3d_core.result import Result
from dap3d_core.result.arrays import ModelSummary
from dap3d_core.scene import SceneError, load, parse
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.colors import colors
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry, Elements
from dap3d_core.view.scene3d.primitives import (
    Located,
    Mark,
    Point,
    Span,
    ball,
    bar,
    floats_of,
    pack,
    turned_to,
)
from dap3d_core.view.scene3d.sampled_motion import Extent, Motion, stage
from dap3d_core.view.scene3d.shapes import GROUND_COLOR, Mesh, SceneShapes, scene_shapes

#: The longest semi-axis of a body without points, as a part of the scene's size: nothing is hidden.
MODEST = 0.03
#: Points this near, relative to the largest coordinate, are one.
_SAME = 1e-6
#: One calm colour for all joints, one for springs; bodies have colours of their own.
JOINT, FORCE = "#5b6470", "#8a6d3b"

Pieces = Iterable[Mark | Span]


def scene_of(result: Result, model: str | os.PathLike[str] | None = None) -> Scene:
    """The scene of a result; its folder is that of the model, where one is named."""
    try:
        scene = parse(result.scene_text).resolved()
    except SceneError:  # a result made by a script, without the text of a scene
        scene = Scene()
    if model is not None:
        scene.path = load(model).path
    for name in result.summary.body_names:
        if name not in scene.bodies:
            scene.add_body(name)
    return scene


@attrs.frozen(eq=False)
class SceneGeometry:
    """The solids that show a scene.

    Attributes:
        names, colors: of the bodies, without ground.
        marks, spans: solids fixed in bodies, and those between two.
        shapes: lines, meshes and notes of the scene's shapes; its solids are among the marks.
        extent: of the motion, with the solids.
        unit: radius of a thin link, m.
    """

    names: tuple[str, ...]
    colors: list[str]
    marks: list[Mark]
    spans: list[Span]
    shapes: SceneShapes
    extent: Extent
    unit: float


def scene_geometry(result: Result, scene: Scene, elements: Elements) -> SceneGeometry:
    """The solids of a result with its scene, whose folder, where known, holds its meshes."""
    summary, motion = result.summary, Motion(result)
    named = [scene.bodies[name].color for name in summary.body_names]
    hues = colors(named, [joint.moving for joint in elements.joints])
    shapes = scene_shapes(scene, summary.body_names, hues, elements.surfaces)
    points = attachment_points(summary, [*elements.joints, *elements.contacts, *elements.forces])
    bodies = range(1, summary.body_count + 1)
    bounds = [(k, ORIGIN) for k in bodies] + shapes.corners
    bounds += [(k, at) for k, on_body in enumerate(points) for at in on_body]
    bare = [k for k in bodies if not points[k] and k not in shapes.bodies | shapes.touching]
    low, high, _ = motion.extent(bounds)
    size = float(np.linalg.norm(high - low))
    unit = unit_of(points, size or 1.0)
    marks = _bodies(result, points, shapes.bodies, unit, hues, elements.joints)
    symbols = _bare_bodies(result, bare, elements.joints, size, hues)
    reach = max((max(m.size) for m in symbols), default=0.0)
    reach = max([reach, *(j.numbers.get("radius", 0.0) for j in elements.joints)])
    extent = motion.extent(bounds, reach + 2.0 * unit)
    drawer = Drawer(motion, unit, elements.joints)
    pieces = [piece for j in elements.joints for piece in drawer.joint(j)]
    pieces += [piece for f in elements.forces for piece in drawer.force(f)]
    marks += [*symbols, *shapes.marks, *(p for p in pieces if isinstance(p, Mark))]
    spans = [p for p in pieces if isinstance(p, Span)]
    return SceneGeometry(summary.body_names, hues, marks, spans, shapes, extent, unit)


def geometry_of(result: Result, scene: Scene, elements: Elements) -> dict[str, Any]:
    """The solids of a result, as plain data for the page; arguments as ``scene_geometry``."""
    geometry = scene_geometry(result, scene, elements)
    return {
        "stage": {**stage(geometry.extent, elements.gravity), "unit": geometry.unit},
        "bodies": [
            {"name": n, "color": c} for n, c in zip(geometry.names, geometry.colors, strict=True)
        ],
        "points": _points(result),
        "joints": [_about(j, geometry.names) for j in elements.joints],
        "forces": [_about(f, geometry.names) for f in elements.forces],
        "marks": [_row(m) for m in geometry.marks],
        "spans": [attrs.asdict(s) for s in geometry.spans],
        "lines": [attrs.asdict(line) for line in geometry.shapes.lines],
        "meshes": [_packed_mesh(mesh) for mesh in geometry.shapes.meshes],
        "notes": notes_of(elements, geometry.shapes),
    }


def _packed_mesh(mesh: Mesh) -> dict[str, Any]:
    about = attrs.asdict(mesh, filter=lambda a, _: a.name not in ("vertices", "triangles"))
    about |= {"vertices": pack(mesh.vertices), "triangles": pack(mesh.triangles, "<u4")}
    return {**about, "count": len(mesh.triangles)}


def _bodies(
    result: Result,
    points: list[list[Point]],
    shaped: set[int],
    unit: float,
    hues: Sequence[str],
    joints: list[ElementGeometry],
) -> list[Mark]:
    """Links of the bodies without shapes; of ground short posts at joints."""
    marks: list[Mark] = []
    joined = {point for joint in joints for point in joint.points.values()}
    for k, name in enumerate(result.summary.body_names, 1):
        if k not in shaped and points[k]:
            ends = [at for at in points[k] if (k, at) not in joined]
            marks += links(k, points[k], unit, hues[k - 1], name, ends=ends)
    if 0 not in shaped:
        marks += [
            Mark("bodies", "box", 0, at, (4.5 * unit,) * 3, color=GROUND_COLOR, owner="ground")
            for at in [*points[0], ORIGIN]
            if (0, at) in joined
        ]
    return marks


def _bare_bodies(
    result: Result, bare: list[int], joints: list[ElementGeometry], size: float, hues: Sequence[str]
) -> list[Mark]:
    """Bodies without points: their ellipsoids of inertia, and axes, which show that they turn.

    A wheel is drawn by its joint.
    """
    summary = result.summary
    wheels = {j.bodies["i"] for j in joints if j.symbol == "wheel"}
    most = MODEST * size if size > 0.0 else np.inf
    marks: list[Mark] = []
    for k in (k for k in bare if k not in wheels):
        mass, Jp = summary.mass[k - 1], summary.Jp[k - 1]
        hue, name = hues[k - 1], summary.body_names[k - 1]
        ellipsoid = inertia_ellipsoid(k, mass, Jp, most, hue, name)
        reach = max(ellipsoid.size)
        arms = [floats_of(axis) for axis in 1.5 * reach * np.eye(3)]
        marks += [ellipsoid, *links(k, arms, 0.06 * reach, hue, name)]
    return marks


def _points(result: Result) -> list[dict[str, Any]]:
    summary = result.summary
    columns = zip(summary.point_names, summary.point_body, summary.point_local, strict=True)
    return [{"name": n, "body": int(b), "at": at.tolist()} for n, b, at in columns]


def _about(one: ElementGeometry, names: Sequence[str]) -> dict[str, Any]:
    bodies = [names[b - 1] if b else "ground" for b in one.bodies.values()]
    place = one.place(next(iter(one.bodies)))
    return {"name": one.name, "type": one.keyword, "bodies": bodies, "body": place[0],
            "at": place[1]}  # fmt: skip


def _row(mark: Mark) -> list[Any]:
    """A mark without the names of its attributes, in seven digits: there are many."""
    numbers = ([float(f"{x:.7g}") for x in values] for values in (mark.at, mark.size, mark.q))
    return [mark.layer, mark.kind, mark.body, *numbers, mark.color, mark.owner]


def notes_of(elements: Elements, shapes: SceneShapes) -> list[str]:
    """Notes on parts of a scene that are not drawn."""
    missing = f"joints and forces are not drawn: {elements.missing}"
    return [*([missing] if elements.missing else []), *shapes.notes]


def attachment_points(
    summary: ModelSummary, elements: Iterable[ElementGeometry]
) -> list[list[Point]]:
    """The points (m, body axes) of each body, ground first: its own, and those of elements.

    The origin is left out, and so are duplicates.
    """
    attached: list[list[Point]] = [[] for _ in range(summary.body_count + 1)]
    for body, at in zip(summary.point_body, summary.point_local, strict=True):
        attached[int(body)].append(floats_of(at))
    for one in elements:
        for body, at in one.points.values():
            attached[body].append(at)
    return [_distinct(points) for points in attached]


def _distinct(points: list[Point]) -> list[Point]:
    size = max((abs(x) for point in points for x in point), default=0.0)
    kept: dict[tuple[int, ...], Point] = {}
    for point in points:
        if size > 0.0 and max(map(abs, point)) > _SAME * size:
            kept.setdefault(tuple(round(x / (_SAME * size)) for x in point), point)
    return list(kept.values())


def unit_of(points: list[list[Point]], size: float) -> float:
    """Radius of a link, m, by the usual length of links and the size of the scene, m."""
    lengths = [float(np.linalg.norm(at)) for on_body in points[1:] for at in on_body]
    usual = 0.05 * float(np.median(lengths)) if lengths else 0.01 * size
    return float(np.clip(usual, 0.0012 * size, 0.008 * size))


def links(body: int, points: list[Point], unit: float, color: str, name: str,
          *, ends: Iterable[Point] = ()) -> list[Mark]:  # fmt: skip
    """Links of a radius ``unit`` from the origin of a body to points, and a ball at its origin.

    ``ends`` are the points that have a ball, as no joint is drawn there.
    """
    marks = [
        bar(body, 0.5 * np.add(ORIGIN, at), at, unit, float(np.linalg.norm(at))) for at in points
    ]
    marks.append(ball(body, ORIGIN, 1.5 * unit))
    marks += [ball(body, at, 1.25 * unit) for at in ends]
    return [attrs.evolve(mark, layer="bodies", color=color, owner=name) for mark in marks]


def inertia_ellipsoid(body: int, mass: float, Jp: Floats, most: float, color: str,
                      name: str) -> Mark:  # fmt: skip
    """The homogeneous ellipsoid of a mass (kg) and an inertia (3, 3) in body axes (kg m^2).

    Its semi-axes are a_k^2 = 5 (J_1 + J_2 + J_3 - 2 J_k) / (2 m) along the principal axes, all
    scaled down where one is longer than ``most``, m.
    """
    J, axes = np.linalg.eigh(Jp)
    semi = np.sqrt(np.maximum(2.5 * (J.sum() - 2.0 * J) / mass, 0.0))
    semi = np.maximum(semi, 0.05 * semi.max())
    semi *= min(1.0, most / semi.max())
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Mark("inertia", "sphere", body, ORIGIN, floats_of(semi), quaternion(axes), color, name)


@attrs.frozen(eq=False)
class Drawer:
    """Draws elements of one scene.

    Attributes:
        motion: poses of its bodies.
        unit: radius of a thin link, m; all sizes follow it.
        joints: all joints, among which a driver finds the one it drives.
    """

    motion: Motion
    unit: float
    joints: Sequence[ElementGeometry]

    def joint(self, one: ElementGeometry) -> list[Mark | Span]:
        """The solids of a joint."""
        return self._draw(one, one.symbol, "joints", JOINT)

    def force(self, one: ElementGeometry) -> list[Mark | Span]:
        """The solids of a force: a spring between its ends, or what its type declares.

        A force between two bodies whose type declares no point on them, such as a contact, has no
        solids: bodies that it does not touch would look joined. Its arrow shows where it acts.
        """
        if not (one.symbol or one.points or one.vectors):
            return []
        return self._draw(one, one.symbol or ("spring" if one.has_ends else ""), "forces", FORCE)

    def _draw(self, one: ElementGeometry, symbol: str, layer: str, color: str) -> list[Mark | Span]:
        pieces = DRAWINGS[symbol](self, one)
        return [attrs.evolve(p, layer=layer, color=color, owner=one.name) for p in pieces]

    def start(self, body: int, point: Located) -> Located:
        """A point of another body at the first instant, in coordinates of a body."""
        at = self.motion.points([point])[0, 0]
        if body:
            at = self.motion.vector_in(body, at - self.motion.result.r[0, body - 1])
        return body, floats_of(at)

    def home(self, one: ElementGeometry, body: int) -> Located:
        """The point on a body of an element without points.

        It is at the driven joint, one with a point between the same bodies; else at the origin of
        the element's first moving body.
        """
        between = set(one.bodies.values())
        for other in self.joints:
            if other is not one and other.points and set(other.bodies.values()) == between:
                return self.start(body, next(iter(other.points.values())))
        return self.start(body, (next(iter(one.moving), 0), ORIGIN))

    def base(self, one: ElementGeometry, field: str) -> Located:
        """The start of the vector of a field: the point of its slot, or the home."""
        slot, body = slot_of(field) or "", one.vectors[field][0]
        point = one.points.get(slot)
        if point is not None and point[0] == body:
            return point
        if one.points:
            return self.start(body, next(iter(one.points.values())))
        return self.home(one, body)


def _ball(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ball at the point; of an element without points around that of its joint."""
    if one.points:
        yield ball(*one.place("i"), 1.8 * to.unit)
    else:
        yield ball(*to.home(one, one.bodies["i"]), 2.6 * to.unit)


def _cross(to: Drawer, one: ElementGeometry) -> Pieces:
    """The two arms of the cross, each fixed in its body."""
    yield ball(*one.place("i"), 1.5 * to.unit)
    for field in ("a_i", "n_j"):
        body, axis = one.vectors[field]
        yield bar(body, to.base(one, field)[1], axis, 0.9 * to.unit, 8.0 * to.unit)


def _hinge(to: Drawer, one: ElementGeometry) -> Pieces:
    """A pin along the axis, with a collar at its middle."""
    body, at = one.place("i")
    axis = one.vectors["a_i"][1]
    yield bar(body, at, axis, 1.1 * to.unit, 7.0 * to.unit)
    yield bar(body, at, axis, 2.0 * to.unit, 2.6 * to.unit)


def _link(to: Drawer, one: ElementGeometry) -> Pieces:
    start, end = one.place("i"), one.place("j")
    yield Span("", "rod", start, end, 0.8 * to.unit)
    yield ball(*start, 1.6 * to.unit)
    yield ball(*end, 1.6 * to.unit)


def _plate(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ball on the body and a plate on ground, both at the point."""
    yield ball(*one.place("i"), 2.0 * to.unit)
    at = to.motion.points([one.place("i")])[0, 0]
    yield bar(0, at, one.vectors["a_j"][1], 7.0 * to.unit, 0.3 * to.unit)


def _ring(to: Drawer, one: ElementGeometry) -> Pieces:
    """A ring about the first vector, the axis of a rotation."""
    field, (_, axis) = next(iter(one.vectors.items()))
    yield Mark("", "ring", *to.base(one, field), (4.0 * to.unit,) * 3, turned_to(axis))


def _on_rail(to: Drawer, one: ElementGeometry, kind: str, width: float) -> Pieces:
    """A rail along a_j, as long as the motion, and a solid on it."""
    (body, at), (rail_body, rail_at), along = one.place("i"), one.place("j"), one.vectors["a_j"]
    direction = to.motion.direction(along)
    ends = to.motion.points([one.place("i"), one.place("j")])
    reach = np.einsum("tc,tc->t", ends[:, 0] - ends[:, 1], direction)
    low, high = min(reach.min(), 0.0) - 6.0 * to.unit, max(reach.max(), 0.0) + 6.0 * to.unit
    middle = np.asarray(rail_at) + 0.5 * (low + high) * np.asarray(along[1])
    yield bar(rail_body, middle, along[1], 0.7 * to.unit, float(high - low))
    axis = to.motion.vector_in(body, direction[0])
    yield Mark("", kind, body, at, (width, width, 6.0 * to.unit), turned_to(axis))


def _wheel(to: Drawer, one: ElementGeometry) -> Pieces:
    """A thin disk about the y axis of the body, with spokes that show how it turns."""
    body, R = one.bodies["i"], one.numbers["radius"]
    y = (0.0, 1.0, 0.0)
    yield Mark("", "ring", body, ORIGIN, (0.95 * R, 0.95 * R, 0.5 * R), turned_to(y))
    yield bar(body, ORIGIN, y, 0.12 * R, 3.0 * (0.04 * R))
    for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        yield bar(body, ORIGIN, axis, 0.035 * R, 1.9 * R)
    yield ball(body, (0.95 * R, 0.0, 0.0), 0.1 * R)


def _declared_fields(to: Drawer, one: ElementGeometry) -> Pieces:
    """Points as balls, vectors as lines, a vector between points as a rod, a list as a chain."""
    if one.has_ends:
        yield Span("", "rod", one.place("i"), one.place("j"), 0.5 * to.unit)
    for start, end in pairwise(one.chain):
        yield Span("", "rod", start, end, 0.5 * to.unit)
    for point in one.chain or one.points.values():
        yield ball(*point, 1.8 * to.unit)
    for field, (_, axis) in one.vectors.items():
        yield bar(*to.base(one, field), axis, 0.6 * to.unit, 12.0 * to.unit)
    if not one.points and not one.vectors:
        for start, end in pairwise([(body, ORIGIN) for body in one.moving]):
            yield Span("", "rod", start, end, 0.5 * to.unit)


#: Symbol (``interface.types.SYMBOLS``) -> what draws it.
DRAWINGS: dict[str, Callable[[Drawer, ElementGeometry], Pieces]] = {
    "": _declared_fields,
    "ball": _ball,
    "block": lambda to, one: [Mark("", "box", one.bodies["i"], ORIGIN, (4.5 * to.unit,) * 3)],
    "cross": _cross,
    "hinge": _hinge,
    "link": _link,
    "plate": _plate,
    "ring": _ring,
    "sleeve": lambda to, one: _on_rail(to, one, "cylinder", 2.2 * to.unit),
    "slider": lambda to, one: _on_rail(to, one, "box", 4.0 * to.unit),
    "spring": lambda to, one: [Span("", "spring", one.place("i"), one.place("j"), 2.2 * to.unit)],
    "wheel": _wheel,
}
