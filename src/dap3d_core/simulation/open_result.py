"""Results from disk, with the way back to a model for what only a model can compute."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface import PluginError
from dap3d_core.model import Model
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, ResultError, information
from dap3d_core.result import open_result as open_file
from dap3d_core.scene import SceneError, load, parse
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.output.type_sources import changed_types

#: Of results that older versions of dap3d wrote.
NOT_RECORDED = (
    "the file does not say which sources its types had, so that reactions, forces and the Jacobian "
    "cannot be protected from formulas that have changed since the run"
)


@checked
def open_result(
    path: str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
) -> Result:
    """Open a result file.

    Positions, velocities, accelerations, multipliers and energies come from the file; the Jacobian,
    reactions and quantities of forces are computed on demand, which loads the types that the
    stored scene names.

    Args:
        path: a NetCDF file that ``Result.save`` or ``dap3d run`` wrote.
        model: the model (a name, a folder, a file) whose own types, in its ``plugin.py``, the run
            used. A result does not say where they stand, so that opening one never runs a file
            that it points to.
        allow_code: whether that ``plugin.py`` may be loaded.

    Raises:
        ResultError: missing, truncated, newer, or not a result.
        SceneError: there is no such model.
    """
    home = None if model is None else load(model).path

    def rebuild(scene_text: str) -> tuple[Model, Callable[[], Evaluator]]:
        compiled = compile_again(
            scene_text,
            home,
            lambda reason: ResultError(
                f"the model of {path} cannot be made again, which the Jacobian, reactions and "
                f"forces need: {reason}. All other arrays are in the file"
            ),
            allow_code=allow_code,
        )
        _check_types(path, known, compiled)
        return compiled.model, lambda: compiled.evaluator

    result = open_file(path, rebuild)
    known = result.record.types  # read by ``rebuild``, which is called later
    if known is None:
        notes = (*result.notes, information(f"{NOT_RECORDED}"))
        result.record = attrs.evolve(result.record, notes=notes)
    return result


def _check_types(
    path: str | os.PathLike[str],
    known: Mapping[str, Mapping[str, str]] | None,
    compiled: CompiledModel,
) -> None:
    changed = changed_types(known or {}, compiled.types)
    if changed:
        raise ResultError(
            f"the formulas of {', '.join(changed)} have changed since the run of {path}: the "
            "Jacobian, reactions and forces cannot be computed with them. Bring back the files of "
            "these types, or run the scene again. All other arrays are in the file"
        )


def compile_again(
    scene_text: str, home: Path | None, refuse: Callable[[str], Exception], **options: Any
) -> CompiledModel:
    """The model of a stored scene.

    Args:
        scene_text: the scene.
        home: folder of its own types, which the file does not say; None for none.
        refuse: makes an error of the reason why there is no such model, with the remedy.
        options: of ``CompiledModel``, ``allow_code`` among them.
    """
    scene = parse(scene_text)
    scene.path = home
    try:
        return CompiledModel(scene, **options)
    except (PluginError, SceneError, SimulationError) as error:
        mistakes = getattr(error, "mistakes", None)
        reason = f"{mistakes[0].what if mistakes else error}; install what brings the type"
        if not options["allow_code"] or home is None:
            reason += (
                " or, where that is the plugin.py of the model, name the model and allow its code: "
                "model=FOLDER, allow_code=True, or on the command line --model FOLDER --allow-code"
            )
        raise refuse(reason) from error
