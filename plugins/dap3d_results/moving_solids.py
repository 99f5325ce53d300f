"""A result as solids that move, for the writers of VTK and glTF files."""

import os

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import to_global
from dap3d_core.result import Result
from dap3d_core.view.scene3d.elements import elements_of
from dap3d_core.view.scene3d.primitives import Span, Triangles, solid, spring, turned_to
from dap3d_core.view.scene3d.sampled_motion import Motion, stage
from dap3d_core.view.scene3d.scene_data import notes_of, scene_geometry, scene_of
from dap3d_core.view.scene3d.shapes import Line, Part, parts_of

#: Colour where none can be read, each part from 0 to 255.
GREY = (154, 163, 173)


@attrs.frozen(eq=False)
class Stretched:
    """Triangles between points of two bodies.

    Attributes:
        form: along z, of unit length about the origin.
        at, q, size: (nt, 3) m, (nt, 4), (nt, 3): place of its axes, and factors along them.
        color, layer, owner: as of a span.
    """

    form: Triangles
    at: Floats
    q: Floats
    size: Floats
    color: str
    layer: str
    owner: str

    @classmethod
    def of(cls, span: Span, motion: Motion) -> "Stretched":
        """A span at all instants; its rotations are continuous."""
        ends = motion.points([span.start, span.end])
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        q = np.array([turned_to(one) for one in along])
        flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
        q[1:] *= flips[:, None]
        size = np.column_stack([np.full((len(length), 2), span.radius), length])
        slenderness = max(1.0, float(np.mean(length)) / span.radius)
        form = spring(slenderness) if span.kind == "spring" else solid("cylinder")
        return cls(form, ends.mean(axis=1), q, size, span.color, span.layer, span.owner)

    def vertices(self, instant: int) -> Floats:
        """(k, 3) global, m."""
        turned = to_global(self.q[instant], self.form.vertices * self.size[instant])
        return np.asarray(self.at[instant] + turned)


@attrs.frozen(eq=False)
class MovingScene:
    """The solids of a result.

    Attributes:
        result: the result.
        parts, stretched, lines: its solids.
        up: (3,) unit vector against gravity.
        notes: parts of the scene that are left out, and why.
    """

    result: Result
    parts: list[Part]
    stretched: list[Stretched]
    lines: list[Line]
    up: tuple[float, ...]
    notes: list[str]

    @classmethod
    def of(cls, result: Result, model: str | os.PathLike[str] | None) -> "MovingScene":
        """The moving scene of a result; the folder of the model holds its meshes."""
        scene = scene_of(result, model)
        elements = elements_of(result)
        geometry = scene_geometry(result, scene, elements)
        motion = Motion(result)
        return cls(
            result=result,
            parts=parts_of(geometry.marks, geometry.shapes.meshes),
            stretched=[Stretched.of(span, motion) for span in geometry.spans],
            lines=geometry.shapes.lines,
            up=stage(geometry.extent, elements.gravity)["up"],
            notes=notes_of(elements, geometry.shapes),
        )


def rgb(color: str) -> tuple[int, ...]:
    """A colour as a browser writes it, as three numbers from 0 to 255."""
    from PIL import ImageColor

    try:
        return ImageColor.getrgb(color)[:3]
    except ValueError:
        return GREY
