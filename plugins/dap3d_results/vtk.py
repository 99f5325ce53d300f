"""A moving scene as a VTKHDF file, which ParaView reads: one file with its points at each instant.

The form is that of "PolyData" with steps, version 2.0: cells are stored once, the points of all
instants behind one another. Every netCDF-4 file is an HDF5 file, so that netCDF4 writes it.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from dap3d_core.interface.formats import Exporter, ResultExporter, hookimpl
from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import rotation
from dap3d_core.result import ResultError
from dap3d_core.result.file.library import created
from dap3d_core.view.scene3d.primitives import LAYERS
from dap3d_core.view.scene3d.shapes import Line, Part
from dap3d_results.moving_solids import MovingScene, rgb

Progress = Callable[[int, int], None]

#: Kinds of cells, in the order of the form.
CELLS = ("Vertices", "Lines", "Polygons", "Strips")
#: Numbers of coordinates that are computed at once.
BLOCK = 3_000_000
#: Files of points beyond this are refused, bytes.
LARGEST = 8 * 2**30

interface_version = 1


class VtkExporter(ResultExporter):
    """The moving scene for ParaView 5.12 and later."""

    keyword, title, suffix = "vtk", "VTK", ".vtkhdf"

    def write_result(
        self, result: Any, path: Path, *, model: Any, progress: Progress | None
    ) -> list[str]:
        """Write a file; returns notes."""
        moving = MovingScene.of(result, model)
        points, instants = point_count(moving), len(result.t)
        if 24 * points * instants > LARGEST:
            raise ResultError(
                f"{points:,} points at {instants:,} instants are {24 * points * instants / 1e9:.1f}"
                f" GB, more than {LARGEST / 1e9:.1f}: a smaller fps leaves instants out"
            )
        with created(path, path) as file:
            _fill(file, moving, progress)
        return moving.notes


def point_count(scene: MovingScene) -> int:
    """Number of points at each instant."""
    rigid = sum(len(one.vertices) for one in _by_body(scene))
    return rigid + sum(len(one.form.vertices) for one in scene.stretched)


def _fill(file: Any, scene: MovingScene, progress: Progress | None) -> None:
    root, t = file.createGroup("VTKHDF"), scene.result.t
    root.setncattr("Version", np.array([2, 0], dtype=np.int64))
    root.setncattr("Type", np.bytes_("PolyData"))
    count = point_count(scene)
    _column(root, "NumberOfPoints", [count])
    _cells(root, scene)
    steps = root.createGroup("Steps")
    steps.setncattr("NSteps", np.int64(len(t)))
    _column(steps, "Values", t, "f8")
    nothing = np.zeros(len(t), dtype=np.int64)
    for name in ("PartOffsets", "NumberOfParts"):
        _column(steps, name, nothing + (name == "NumberOfParts"))
    _column(steps, "PointOffsets", count * np.arange(len(t)))
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        _column(steps, name, np.zeros((len(t), len(CELLS)), dtype=np.int64))
    points = _array(root, "Points", "f8", (count * len(t), 3), chunk=count)
    done = 0
    for block in _blocks(scene, count):
        points[count * done : count * (done + len(block))] = block.reshape(-1, 3)
        done += len(block)
        if progress is not None:
            progress(done, len(t))


def _cells(root: Any, scene: MovingScene) -> None:
    """Write lines, then triangles, with their bodies, layers and colours."""
    rigid = _by_body(scene)
    counts = [len(one.vertices) for one in rigid] + [len(s.form.vertices) for s in scene.stretched]
    none = np.zeros(0, dtype=np.int64)
    triangles, lines = [none.reshape(0, 3)], [none]
    faces: list[Any] = []
    edges: list[Any] = []
    for one, end, count in zip([*rigid, *scene.stretched], np.cumsum(counts), counts, strict=True):
        if isinstance(one, Line):
            lines.append(end - count + np.arange(count))
            edges.append(one)
        else:
            triangles.append(end - count + one.form.triangles)
            faces.append(one)
    corners = np.concatenate(triangles)
    cells = {
        "Vertices": (none, none),
        "Lines": (np.concatenate(lines), np.cumsum([len(line) for line in lines[1:]])),
        "Polygons": (corners.ravel(), 3 * np.arange(1, len(corners) + 1)),
        "Strips": (none, none),
    }
    for name, (connectivity, ends) in cells.items():
        group = root.createGroup(name)
        _column(group, "NumberOfCells", [len(ends)])
        _column(group, "NumberOfConnectivityIds", [len(connectivity)])
        _column(group, "Connectivity", connectivity)
        _column(group, "Offsets", [0, *ends])
    each = np.repeat(np.arange(len(edges) + len(faces)),
                     [1] * len(edges) + [len(one.form.triangles) for one in faces])  # fmt: skip
    owners, data = [*edges, *faces], root.createGroup("CellData")
    body = np.array([getattr(one, "body", -1) for one in owners], dtype=np.int64)
    layer = np.array([LAYERS.index(one.layer) for one in owners], dtype=np.int64)
    color = np.array([rgb(one.color) for one in owners], dtype=np.uint8).reshape(-1, 3)
    _column(data, "body", body[each])
    _column(data, "layer", layer[each])
    _column(data, "color", color[each], "u1")


def _by_body(scene: MovingScene) -> list[Part | Line]:
    """Parts and lines in the order of their bodies."""
    return sorted([*scene.parts, *scene.lines], key=lambda one: one.body)


def _blocks(scene: MovingScene, count: int) -> Iterator[Floats]:
    """Points (instants, count, 3), m, of several instants at a time."""
    bodies = [
        (body, np.concatenate([one.vertices for one in ones]))
        for body, ones in groupby(_by_body(scene), key=lambda one: one.body)
    ]
    r, p = scene.result.r, scene.result.p
    step = max(1, BLOCK // (3 * max(count, 1)))
    for start in range(0, len(r), step):
        some = slice(start, min(start + step, len(r)))
        out, end = np.empty((some.stop - start, count, 3)), 0
        for body, local in bodies:
            index = slice(end, end := end + len(local))
            out[:, index] = local
            if body:
                A = rotation(p[some, body - 1])
                out[:, index] = r[some, body - 1, None] + local @ A.transpose(0, 2, 1)
        for one in scene.stretched:
            index = slice(end, end := end + len(one.form.vertices))
            out[:, index] = [one.vertices(k) for k in range(some.start, some.stop)]
        yield out


def _column(group: Any, name: str, values: Iterable[Any], kind: str = "i8") -> None:
    array = np.asarray(values)
    _array(group, name, kind, array.shape)[:] = array


def _array(
    group: Any, name: str, kind: str, shape: tuple[int, ...], chunk: int | None = None
) -> Any:
    """A variable; its dimensions are in the root group, which VTK does not read."""
    file = group
    while file.parent is not None:
        file = file.parent
    names = [f"size_{size}" for size in shape]
    for name_of_size, size in zip(names, shape, strict=True):
        if name_of_size not in file.dimensions:
            file.createDimension(name_of_size, size or None)
    chunks = None if chunk is None else (max(1, min(chunk, 200_000)), shape[1])
    return group.createVariable(
        name, kind, tuple(names), fill_value=False, zlib=chunk is not None, complevel=1,
        shuffle=True, chunksizes=chunks,
    )  # fmt: skip


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    return [VtkExporter]
