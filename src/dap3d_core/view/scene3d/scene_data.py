"""Solids that show a result: bodies, shapes, joints, forces, ground; and the camera."""

import os
from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.result import Result
from dap3d_core.scene import SceneError, load, parse
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.bodies import attachment_points, bare_body, links, unit_of
from dap3d_core.view.scene3d.camera import stage
from dap3d_core.view.scene3d.colors import colors
from dap3d_core.view.scene3d.elements import ORIGIN, ElementGeometry, Elements
from dap3d_core.view.scene3d.primitives import Mark, Point, Span, pack
from dap3d_core.view.scene3d.sampled_motion import Extent, Motion
from dap3d_core.view.scene3d.shapes import Mesh, SceneShapes, scene_shapes
from dap3d_core.view.scene3d.symbols import Drawer

#: The colour of what belongs to ground.
GROUND = "#9aa3ad"
#: The longest semi-axis of a body without points, as a part of the scene's size: nothing is hidden.
MODEST = 0.03


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
    hues = colors([scene.bodies[n].color for n in summary.body_names], _pairs(elements.joints))
    shapes = scene_shapes(scene, summary.body_names, hues)
    every = [*elements.joints, *elements.forces]
    points = attachment_points(summary, every)
    bodies = range(1, summary.body_count + 1)
    bounds = [(k, ORIGIN) for k in bodies] + shapes.corners
    bounds += [(k, at) for k, on_body in enumerate(points) for at in on_body]
    bare = [k for k in bodies if not points[k] and k not in shapes.bodies]
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


def _pairs(joints: Iterable[ElementGeometry]) -> list[tuple[int, ...]]:
    """The bodies of each joint, without ground."""
    return [tuple(body for body in joint.bodies.values() if body) for joint in joints]


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
            Mark("bodies", "box", 0, at, (4.5 * unit,) * 3, color=GROUND, owner="ground")
            for at in [*points[0], ORIGIN]
            if (0, at) in joined
        ]
    return marks


def _bare_bodies(
    result: Result, bare: list[int], joints: list[ElementGeometry], size: float, hues: Sequence[str]
) -> list[Mark]:
    """Bodies without points; a wheel is drawn by its joint."""
    summary = result.summary
    wheels = {j.bodies["i"] for j in joints if j.symbol == "wheel"}
    most = MODEST * size if size > 0.0 else np.inf
    columns = zip(summary.mass, summary.Jp, hues, summary.body_names, strict=True)
    return [
        mark
        for k, (mass, Jp, hue, name) in enumerate(columns, 1)
        if k in bare and k not in wheels
        for mark in bare_body(k, mass, Jp, most, hue, name)
    ]


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
