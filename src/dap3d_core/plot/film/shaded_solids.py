"""Shapes of bodies in films and snapshots: triangles, shaded, the nearest drawn last."""

from collections.abc import Sequence

import attrs
import numpy as np
from matplotlib.colors import is_color_like, to_hex, to_rgb

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import to_global
from dap3d_core.plot.film.projection import Camera
from dap3d_core.scene.scene import Scene
from dap3d_core.view.scene3d.shapes import GROUND_COLOR, parts_of, scene_shapes

#: Shapes of more triangles are not drawn in films, whose every picture draws all of them; and in
#: snapshots. Large triangles are divided as long as there are fewer than the first in all.
MOST_TRIANGLES, MOST_IN_SNAPSHOTS = 30_000, 400_000
#: Longer edges, as parts of the largest shape, are divided: the middle of a large triangle says
#: little of what it hides.
LONGEST = 0.12
#: The darkest face of a shape, as a fraction of its colour; obliqueness of the light.
DARKEST, OBLIQUE = 0.55, (0.3, 0.5)


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
        points = self.local.copy()
        moving = self.body > 0
        on = self.body[moving] - 1
        points[moving] = r[on] + to_global(p[on], self.local[moving])
        corners = points[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        light = camera.towards + OBLIQUE[0] * camera.right + OBLIQUE[1] * camera.up
        bright = np.abs(normal @ (light / np.linalg.norm(light))) / np.where(length, length, 1.0)
        order = np.argsort(camera.depth(corners).mean(axis=1), kind="stable")
        shade = DARKEST + (1.0 - DARKEST) * bright[order, None]
        return camera.project(corners[order]), self.colors[order] * shade


def shapes_of(
    scene: Scene, names: Sequence[str], colors: Sequence[str], *, still: bool = False
) -> Shapes:
    """The shapes of a scene; arguments as of ``view.scene3d.shapes.scene_shapes``.

    Of too many triangles nothing is drawn, with a note; ``still``, for one picture, allows more.
    """
    most = MOST_IN_SNAPSHOTS if still else MOST_TRIANGLES
    shapes = scene_shapes(scene, names, colors)
    notes = list(shapes.notes)
    parts = [(part, part.vertices) for part in parts_of(shapes.marks, shapes.meshes)]
    size = max((float(np.max(np.ptp(local, axis=0))) for _, local in parts), default=0.0)
    room = MOST_TRIANGLES - sum(len(part.form.triangles) for part, _ in parts)
    pieces = []
    for done, (part, local) in enumerate(parts):
        extra = room // (len(parts) - done)
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
    hues = {piece[0]: to_hex(_rgb(piece[3])) for piece in reversed(pieces)}
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


def _divided(
    local: Floats, triangles: Integers, size: float, extra: int
) -> tuple[Floats, Integers]:
    """Triangles with short edges: long ones are divided into four, repeatedly.

    There are at most ``extra`` more than before.
    """
    most = len(triangles) + extra
    corners = local[triangles]
    for _ in range(4):
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(axis=1) > LONGEST * size
        if not long.any() or 3 * long.sum() + len(corners) > most:
            break
        a, b, c = corners[long].swapaxes(0, 1)
        d, e, f = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        four = [np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))]
        corners = np.concatenate([corners[~long], *four])
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
