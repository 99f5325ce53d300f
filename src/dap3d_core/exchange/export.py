"""``export``: a result as a file that another program reads."""

import os
from collections.abc import Callable
from pathlib import Path

import attrs

from dap3d_core.result import Result, ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.view.scene3d.sampled_motion import chosen, thinned
from dap3d_core.view.scene3d.scene_data import scene_of

#: Format -> suffix of its files.
FORMATS = {"vtk": ".vtkhdf", "gltf": ".glb", "mat": ".mat", "csv": ".csv"}
#: Files of moving points beyond this are refused, bytes.
LARGEST = 8 * 2**30

Progress = Callable[[int, int], None]


@attrs.frozen
class Export:
    """A file that ``export`` wrote.

    Attributes:
        path: the file.
        format: one of FORMATS.
        instants: how many it holds.
        notes: what it does not hold, and why.
    """

    path: Path
    format: str
    instants: int
    notes: tuple[str, ...] = ()


def export(
    result: Result,
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    fps: float | None = None,
    model: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    force: bool = False,
) -> Export:
    """Write a result to a file of another program.

    ``vtk`` (.vtkhdf) is the moving scene for ParaView 5.12 and later, ``gltf`` (.glb) for Blender,
    browsers and viewers: shapes, bodies, joints and springs as ``dap.view`` draws them. ``mat``
    holds all arrays for MATLAB and Octave, ``csv`` a column for each component.

    Args:
        result: what to write.
        path: the file.
        format: "vtk", "gltf", "mat" or "csv"; by default what the suffix says.
        fps: instants a second, the nearest reported ones; every instant by default.
        model: the model (a name, a folder, a file) in whose folder meshes of shapes lie.
        progress: called as progress(done, total).
        force: whether an existing file is overwritten.

    Raises:
        ValueError: no instants; a format, a suffix or an fps that cannot be.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    kind = format_of(target, format)
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to export")
    check_fps(fps)
    shown = result if fps is None else thinned(result, chosen(result.t, 1, fps))
    write = _scene if kind in ("vtk", "gltf") else _arrays
    with whole_file(target, force) as part:
        notes = write(shown, part, kind, model, progress)
    return Export(target.absolute(), kind, len(shown.t), tuple(notes))


def format_of(target: Path, format: str | None) -> str:
    """The format that is written to a path.

    Raises:
        ValueError: there is no such format, or the suffix names none or another.
    """
    named = {suffix: kind for kind, suffix in FORMATS.items()}.get(target.suffix.lower())
    if format is not None and format not in FORMATS:
        raise ValueError(f"{format!r} is no format; one of {', '.join(FORMATS)}")
    if format is None and named is None:
        suffixes = ", ".join(FORMATS.values())
        raise ValueError(f"cannot write {target}: name a file with one of {suffixes}, or a format")
    if format is not None and named is not None and format != named:
        raise ValueError(f"cannot write {target}: its name says {named}, not {format}")
    return format or str(named)


def check_fps(fps: float | None) -> None:
    """Refuse a number of instants a second that cannot be.

    Raises:
        ValueError: it is not above 0.
    """
    if fps is not None and not 0.0 < fps <= 1e6:
        raise ValueError(f"fps is a number above 0, at most 1e6, not {fps:g}")


def _scene(
    result: Result,
    part: Path,
    kind: str,
    model: str | os.PathLike[str] | None,
    progress: Progress | None,
) -> list[str]:
    """Write the moving scene; returns notes."""
    from dap3d_core.exchange.gltf import write_gltf
    from dap3d_core.exchange.moving_solids import MovingScene
    from dap3d_core.exchange.vtkhdf import point_count, write_vtkhdf

    scene = MovingScene.of(result, scene_of(result, model))
    if kind == "gltf":
        write_gltf(scene, part, progress)
        return scene.notes
    size = 24 * point_count(scene) * len(result.t)
    if size > LARGEST:
        raise ResultError(
            f"{point_count(scene):,} points at {len(result.t):,} instants are {size / 1e9:.1f} GB, "
            f"more than {LARGEST / 1e9:.1f}: a smaller fps leaves instants out"
        )
    write_vtkhdf(scene, part, progress)
    return scene.notes


def _arrays(
    result: Result,
    part: Path,
    kind: str,
    model: str | os.PathLike[str] | None,
    progress: Progress | None,
) -> list[str]:
    """Write arrays or columns; returns notes."""
    from dap3d_core.exchange.matlab_file import write_mat
    from dap3d_core.result.quantities.csv_table import columns_of, write_csv
    from dap3d_core.result.quantities.netcdf_export import why_no_reactions

    left_out = why_no_reactions(result)
    if kind == "mat":
        write_mat(result, part, reactions=not left_out)
    else:
        write_csv(result, part, columns_of(result, not left_out), force=True)
    return [f"reactions are left out: {left_out}"] if left_out else []
