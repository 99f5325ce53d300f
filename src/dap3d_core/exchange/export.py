"""``export``: a result as a file of another program."""

import os
from collections.abc import Callable
from pathlib import Path

import attrs

from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.scene import Scene
from dap3d_core.view.scene3d.sampled_motion import at_instants, instants_to_show
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
        path, format: the file, and one of FORMATS.
        instants: number of instants in it.
        notes: contents that are left out, and why.
    """

    path: Path
    format: str
    instants: int
    notes: tuple[str, ...] = ()


@checked
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
        result: the result.
        path: the file.
        format: "vtk", "gltf", "mat" or "csv"; by default that of the suffix.
        fps: instants a second, the nearest reported ones; every instant by default.
        model: the model (a name, a folder, a file) in whose folder meshes of shapes lie.
        progress: called as progress(done, total).
        force: overwrites an existing file.

    Raises:
        ValueError: no instants; an invalid format, suffix or fps.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    kind = format_of(target, format)
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to export")
    check_fps(fps)
    shown = result if fps is None else at_instants(result, instants_to_show(result.t, 1, fps))
    with whole_file(target, force) as part:
        if kind in ("vtk", "gltf"):
            notes = _write_scene(shown, scene_of(shown, model), part, kind, progress)
        else:
            notes = _write_arrays(shown, part, kind)
    return Export(target.absolute(), kind, len(shown.t), tuple(notes))


def format_of(target: Path, format: str | None) -> str:
    """The format of a path; a ValueError where there is none, or the suffix names another."""
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
    """Refuse, by a ValueError, an fps that is not above 0."""
    if fps is not None and not 0.0 < fps <= 1e6:
        raise ValueError(f"fps is a number above 0, at most 1e6, not {fps:g}")


def _write_scene(
    result: Result, scene: Scene, part: Path, kind: str, progress: Progress | None
) -> list[str]:
    """Write the moving scene; returns notes."""
    from dap3d_core.exchange.gltf import write_gltf
    from dap3d_core.exchange.moving_solids import MovingScene
    from dap3d_core.exchange.vtkhdf import point_count, write_vtkhdf

    moving = MovingScene.of(result, scene)
    if kind == "gltf":
        write_gltf(moving, part, progress)
        return moving.notes
    size = 24 * point_count(moving) * len(result.t)
    if size > LARGEST:
        raise ResultError(
            f"{point_count(moving):,} points at {len(result.t):,} instants are "
            f"{size / 1e9:.1f} GB, more than {LARGEST / 1e9:.1f}: a smaller fps leaves instants out"
        )
    write_vtkhdf(moving, part, progress)
    return moving.notes


def _write_arrays(result: Result, part: Path, kind: str) -> list[str]:
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
