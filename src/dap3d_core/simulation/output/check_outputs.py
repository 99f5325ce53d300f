"""Check of the outputs of a scene against the quantities that its results have."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import Result, ResultError, RunMetadata, UnknownNameError, find
from dap3d_core.result.quantities.catalogue import SYSTEM
from dap3d_core.result.quantities.outputs import output_quantity
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.mistake_collector import located
from dap3d_core.simulation.initial.released_joints import ReleasedJoints


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


def instant_of(
    scene_text: str,
    evaluator: Evaluator,
    t: float,
    y: Floats,
    complete: Callable[[Floats], None] | None = None,
) -> Result:
    """A result of one instant, at time t and the integrated state y.

    complete: what completes rows of reports, as that of ``Integration``.
    """
    reported = evaluator.reported(t, y)
    row = np.concatenate([[t], evaluator.body_state(y), reported])
    if complete is not None:
        complete(row)
    return _result_of(scene_text, evaluator, row)


def probe_of(scene_text: str, evaluator: Evaluator, u: Floats | None = None) -> Result:
    """A result of one instant, without accelerations and multipliers: u (13 n,), or the start."""
    y = evaluator.integrated(evaluator.model.u0 if u is None else u)
    row = np.concatenate([[0.0], y, np.zeros(evaluator.report_size)])
    return _result_of(scene_text, evaluator, row)


def _result_of(scene_text: str, evaluator: Evaluator, row: Floats) -> Result:
    record = RunMetadata(scene_text=scene_text)
    rows = evaluator.with_inputs(row[None])
    return Result.of_run(evaluator.model, rows, record, lambda: evaluator)


def inactive_joints(scene_text: str, evaluator: Evaluator, u: Floats) -> list[str]:
    """The joints that are not active at the start of a run, at a state u (13 n,)."""
    model = evaluator.model
    evaluator.set_inputs(model.input_values)  # a run before may have left others
    evaluator.states = model.initial_states
    probe = probe_of(scene_text, evaluator, u)
    values = {joint: condition.evaluate({n: find(probe, n).values for n in condition.names})
              for joint, condition in model.active.items()}  # fmt: skip
    return [joint for joint, value in values.items() if not np.all(value > 0.0)]


@contextmanager
def only_active(scene_text: str, evaluator: Evaluator, u: Floats) -> Iterator[None]:
    """Meanwhile the joints that are not active at the start, at a state u (13 n,), do not hold."""
    released = ReleasedJoints(evaluator)
    released.release(inactive_joints(scene_text, evaluator, u))
    try:
        yield
    finally:
        released.put_back()


def check_active(scene: Scene, scene_text: str, evaluator: Evaluator) -> None:
    """Evaluates once what joints are active by.

    Raises:
        SceneError: it is no number, names a quantity that a result will not have or that is the
            joint's own, or an angle that steps by a turn.
    """
    mistakes: list[tuple[Key, Mistake]] = []
    probe, bodies = probe_of(scene_text, evaluator), evaluator.model.body_names
    for joint, condition in evaluator.model.active.items():
        near = remedy = ""
        try:
            operands = {name: find(probe, name) for name in condition.names}
            values = output_quantity(joint, condition, operands, probe.arrays.t.shape).values
            what = "" if values.ndim == 1 else "is a vector, and should be one number"
        except UnknownNameError as error:
            what, near = str(error.args[0]), error.nearest
        except ResultError as error:
            what = str(error).removeprefix(f"the output {joint}: ")
        names = _names_within(condition.names, probe)
        if own := [name for name in names if name.startswith(f"{joint}.")]:
            what = f"names {own[0]}, which is not there while the joint is not"
            remedy = "name quantities of bodies; breaks_at is a limit of its force"
        for body, _, angle in (name.rpartition(".") for name in names):
            if angle in ("roll", "yaw") and body in bodies:
                what = f"names {body}.{angle}, which steps by a turn at pi"
                remedy = "name the angle of another joint, which counts turns"
        if what:
            key = ("joints", joint, "active")
            mistakes.append((key, Mistake(".".join(key), condition.text, what, near, remedy)))
    if mistakes:
        raise SceneError(located(scene, mistakes))


def _names_within(names: Iterable[str], result: Result) -> set[str]:
    """Names of quantities, with those in outputs among them."""
    found: set[str] = set()
    for name in names:
        output = result.outputs.get(name.partition(".")[0])
        found |= {name} if output is None else _names_within(output.names, result)
    return found
