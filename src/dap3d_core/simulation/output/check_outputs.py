"""Check of the outputs of a scene against the quantities that its results have."""

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import Result, ResultError, RunMetadata, UnknownNameError, find
from dap3d_core.result.quantities.catalogue import SYSTEM
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.mistake_collector import located


def check_outputs(scene: Scene, scene_text: str, evaluator: Evaluator) -> None:
    """Evaluates the outputs of a scene once, in its initial state.

    Raises:
        SceneError: an output names a quantity that a result will not have, or is named like one.
    """
    mistakes: list[tuple[Key, Mistake]] = []
    probe = probe_of(scene_text, evaluator)
    reserved = {name.partition(".")[0] for name in SYSTEM}
    for name, output in scene.outputs.items():
        text = output.get("value") if isinstance(output, dict) else output
        key = f"outputs.{name}"
        if name in reserved:
            what = "not a name for an output: every result has a quantity of this name"
            mistakes.append((("outputs", name), Mistake(key, MISSING, what)))
            continue
        try:
            find(probe, name)
        except (UnknownNameError, ResultError) as error:
            near = getattr(error, "nearest", "")
            what = str(error.args[0]) if isinstance(error, UnknownNameError) else str(error)
            mistakes.append((("outputs", name), Mistake(key, text, what, near)))
    if mistakes:
        raise SceneError(located(scene, mistakes))


def probe_of(scene_text: str, evaluator: Evaluator, u: Floats | None = None) -> Result:
    """A result of one instant, without accelerations and multipliers: u (13 n,), or the start."""
    y = evaluator.integrated(evaluator.model.u0 if u is None else u)
    row = np.concatenate([[0.0], y, np.zeros(evaluator.report_size)])
    record = RunMetadata(scene_text=scene_text)
    rows = evaluator.with_inputs(row[None])
    return Result.of_run(evaluator.model, rows, record, lambda: evaluator)
