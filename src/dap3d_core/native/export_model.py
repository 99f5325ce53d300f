"""``export_model``: a scene as a model of another program, or as one that runs by itself."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dap3d_core.formats.export_model import ExportReport
from dap3d_core.formats.export_model import export_model as export_text
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.formats import ResultExporter
from dap3d_core.native.export import NATIVE_FORMATS, NativeExport, export_native
from dap3d_core.native.run.prepared import refusal
from dap3d_core.registry import Registry
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.extensions import extensions
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import Scene


@checked
def export_model(
    scene: Scene | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    format: str | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] | None = None,
    platforms: Sequence[str] | None = None,
    fmi: int = 3,
    t_end: float | None = None,
    method: str | None = None,
    integrator: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    strict: bool = False,
    force: bool = False,
    allow_code: bool = False,
    registry: Registry | None = None,
) -> ExportReport | NativeExport:
    """Write a scene as a model of another program, or as one that runs without Python.

    Args:
        scene: the scene; or its name, folder or file.
        path: the file, of "c" a folder; None writes none, of formats of text. Files of meshes are
            named from its folder, or that of the scene.
        format: "fmu", "c" (header, libraries, an example) or the keyword of an exporter, such as
            "urdf"; by default that of the path's suffix.
        outputs: of "fmu" and "c": names of quantities; by default the outputs of the scene, or
            where it has none the motion of its bodies.
        parameters: numbers that may be set, such as "forces.spring.k".
        platforms: "linux", "windows", "macos", "linux-arm64" ...; by default this one.
        fmi: version of an FMU, 3 or 2. t_end, ..., step: settings as of ``simulate``.
        strict, force: refuse a scene of which something would be left out; overwrite what exists.
        allow_code, registry: as of ``compile``.

    Raises:
        SceneError: the scene is invalid, or cannot be exported so: what, and why.
        SimulationError: its run cannot begin.
        PluginError: there is no such exporter, or it is broken.
        OSError: the file cannot be written, or exists and ``force`` is off.
    """
    kind = format or Path("" if path is None else path).suffix.lstrip(".") or "c"
    chosen: dict[str, Any] = {
        "outputs": outputs, "parameters": parameters, "platforms": platforms, "t_end": t_end,
        "method": method, "integrator": integrator, "rtol": rtol, "atol": atol, "step": step,
    }  # fmt: skip
    given = {name: value for name, value in chosen.items() if value is not None}
    if kind not in NATIVE_FORMATS:
        for name in given:
            raise refusal(f"{name} is of formats {', '.join(NATIVE_FORMATS)}, not of {kind}")
        _require_format(kind)
        return export_text(scene, path, format=kind, strict=strict, force=force, registry=registry)
    if path is None:
        raise refusal(f"format {kind} needs a path", "give that of the file or folder")
    return export_native(
        scene, path, format=kind, fmi=fmi, strict=strict, force=force, allow_code=allow_code,
        registry=registry, **given,
    )  # fmt: skip


def _require_format(kind: str) -> None:
    """Refuse a format that there is not; names those of models, and the nearest."""
    exporters = extensions("exporter")
    if kind in exporters.keywords:
        return

    def is_of_models(keyword: str) -> bool:
        try:
            return not issubclass(exporters.load(keyword), ResultExporter)
        except PluginError:
            return False

    formats = sorted([*NATIVE_FORMATS, *filter(is_of_models, exporters.keywords)])
    near = nearest(kind, formats)
    hint = f"; did you mean {near!r}?" if near else ""
    listed = ", ".join(formats)
    raise PluginError(f"there is no format {kind!r} of models{hint} (there are: {listed})")
