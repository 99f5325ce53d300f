"""The exchange layer: results as files of other programs, by exporters of plugins."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import attrs

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.formats import ResultExporter
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.extensions import extensions
from dap3d_core.result import Result
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.view.scene3d.sampled_motion import at_instants, instants_to_show

Progress = Callable[[int, int], None]


@attrs.frozen
class Export:
    """A file that ``export`` wrote.

    Attributes:
        path, format: the file, and the keyword of its exporter.
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
        format: "vtk", "gltf", "mat", "csv" or one of a plugin; by default that of the suffix.
        fps: instants a second, the nearest reported ones; every instant by default.
        model: the model (a name, a folder, a file) in whose folder meshes of shapes lie.
        progress: called as progress(done, total).
        force: overwrites an existing file.

    Raises:
        ValueError: no instants; an invalid format, suffix or fps.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    exporter = exporter_of(target, format)
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to export")
    check_fps(fps)
    shown = result if fps is None else at_instants(result, instants_to_show(result.t, 1, fps))
    with whole_file(target, force) as part:
        notes = exporter.write_result(shown, part, model=model, progress=progress)
    return Export(target.absolute(), exporter.keyword, len(shown.t), tuple(notes))


def result_exporters() -> dict[str, ResultExporter]:
    """Exporters of results by keyword, without those that cannot be loaded."""
    installed, found = extensions("exporter"), {}
    for keyword in installed.keywords:
        with suppress(PluginError):
            exporter = installed.load(keyword)()
            if isinstance(exporter, ResultExporter):
                found[keyword] = exporter
    return found


def suffix_of(format: str) -> str:
    """The suffix of a format's files.

    Raises:
        PluginError: its exporter cannot be loaded.
    """
    return str(extensions("exporter").load(format).suffix)


def exporter_of(target: Path, format: str | None) -> ResultExporter:
    """The exporter for a path; a ValueError where there is none, or the suffix names another."""
    known = result_exporters()
    named = {one.suffix: one for one in known.values()}.get(target.suffix.lower())
    if format is not None and format not in known:
        if format in extensions("exporter").keywords:
            suffix_of(format)  # says why it cannot be loaded, if that is it
        raise ValueError(f"{format!r} is no format; one of {', '.join(known)}")
    exporter = named if format is None else known[format]
    if exporter is None:
        suffixes = ", ".join(one.suffix for one in known.values())
        raise ValueError(f"cannot write {target}: name a file with one of {suffixes}, or a format")
    if named is not None and exporter is not named:
        raise ValueError(f"cannot write {target}: its name says {named.keyword}, not {format}")
    return exporter


def check_fps(fps: float | None) -> None:
    """Refuse, by a ValueError, an fps that is not above 0."""
    if fps is not None and not 0.0 < fps <= 1e6:
        raise ValueError(f"fps is a number above 0, at most 1e6, not {fps:g}")
