"""A result as solids that move: what the writers of VTK and glTF files draw."""

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import to_global
from dap3d_core.result import Result
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.camera import stage
from dap3d_core.view.scene3d.primitives import Mark, Span, turned_to
from dap3d_core.view.scene3d.sampled_motion import Motion
from dap3d_core.view.scene3d.scene_data import elements_of, notes_of, scene_geometry
from dap3d_core.view.scene3d.shapes import Line
from dap3d_core.view.scene3d.solids import Triangles, solid, spring

#: Colour of what has none that can be read, as parts of 255.
GREY = (154, 163, 173)


@attrs.frozen(eq=False)
class Part:
    """Triangles fixed in a body.

    Attributes:
        key: equal for parts whose triangles are the same.
        form: the triangles, along axes of its own.
        body: index, ground 0.
        at, q, size: (3,) m, (4,), (3,) how its axes lie in the body, and factors along them.
        color: (3,) red, green, blue, parts of 255.
        layer, owner: as of a mark.
    """

    key: object
    form: Triangles
    body: int
    at: tuple[float, ...]
    q: tuple[float, ...]
    size: tuple[float, ...]
    color: tuple[int, ...]
    layer: str
    owner: str

    @property
    def vertices(self) -> Floats:
        """(k, 3) in the axes of the body, m."""
        return np.asarray(np.asarray(self.at) + to_global(self.q, self.form.vertices * self.size))


@attrs.frozen(eq=False)
class Polyline:
    """A line through points (k, 3), m, of a body; else as a part."""

    body: int
    vertices: Floats
    color: tuple[int, ...]
    layer: str
    owner: str


@attrs.frozen(eq=False)
class Stretched:
    """Triangles between points of two bodies: along axes that follow them.

    Attributes:
        form: along z, of unit length about the origin.
        at, q, size: (nt, 3) m, (nt, 4), (nt, 3) how its axes lie, and factors along them.
        color, layer, owner: as of a part.
    """

    form: Triangles
    at: Floats
    q: Floats
    size: Floats
    color: tuple[int, ...]
    layer: str
    owner: str

    def vertices(self, instant: int) -> Floats:
        """(k, 3) global, m."""
        turned = to_global(self.q[instant], self.form.vertices * self.size[instant])
        return np.asarray(self.at[instant] + turned)


@attrs.frozen(eq=False)
class MovingScene:
    """Everything that is drawn of a result.

    Attributes:
        result: whose.
        parts, stretched, lines: what is drawn.
        up: (3,) unit vector against gravity.
        notes: what is not drawn, and why.
    """

    result: Result
    parts: list[Part]
    stretched: list[Stretched]
    lines: list[Polyline]
    up: tuple[float, ...]
    notes: list[str]

    @classmethod
    def of(cls, result: Result, scene: Scene) -> "MovingScene":
        """The moving scene of a result; ``scene`` was run, its folder holds its meshes."""
        elements = elements_of(result)
        found = scene_geometry(result, scene, elements)
        parts = [_of_mark(mark) for mark in found.marks]
        for k, mesh in enumerate(found.shapes.meshes):
            form = Triangles(mesh.vertices, mesh.triangles)
            parts.append(Part(k, form, mesh.body, mesh.at, mesh.q, (mesh.scale,) * 3,
                              rgb(mesh.color), "shapes", mesh.owner))  # fmt: skip
        motion = Motion(result)
        return cls(
            result=result,
            parts=parts,
            stretched=[_of_span(span, motion) for span in found.spans],
            lines=[_of_line(line) for line in found.shapes.lines],
            up=stage(found.extent, elements.gravity)["up"],
            notes=notes_of(elements, found.shapes),
        )


def _of_mark(mark: Mark) -> Part:
    return Part(mark.kind, solid(mark.kind), mark.body, mark.at, mark.q, mark.size,
                rgb(mark.color), mark.layer, mark.owner)  # fmt: skip


def _of_line(line: Line) -> Polyline:
    return Polyline(line.body, np.array(line.points), rgb(line.color), "shapes", line.owner)


def _of_span(span: Span, motion: Motion) -> Stretched:
    ends = motion.points([span.start, span.end])
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    q = np.array([turned_to(one) for one in along])
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    size = np.column_stack([np.full((len(length), 2), span.radius), length])
    slenderness = max(1.0, float(np.mean(length)) / span.radius)
    form = spring(slenderness) if span.kind == "spring" else solid("cylinder")
    return Stretched(form, ends.mean(axis=1), q, size, rgb(span.color), span.layer, span.owner)


def rgb(color: str) -> tuple[int, ...]:
    """A colour as a browser writes it, as three numbers from 0 to 255."""
    from PIL import ImageColor

    try:
        return ImageColor.getrgb(color)[:3]
    except ValueError:
        return GREY
