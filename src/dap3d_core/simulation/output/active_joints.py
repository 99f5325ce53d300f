"""Joints that hold while an expression is positive: its check, and which do where a run starts."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import Result, ResultError, UnknownNameError, find
from dap3d_core.result.quantities.outputs import output_quantity
from dap3d_core.scene import Mistake, Scene, SceneError
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.mistake_collector import located
from dap3d_core.simulation.initial.released_joints import ReleasedJoints
from dap3d_core.simulation.output.check_outputs import probe_of


def inactive_joints(scene_text: str, evaluator: Evaluator, u: Floats) -> list[str]:
    """The joints that are not active at the start of a run, at a state u (13 n,)."""
    model = evaluator.model
    if not model.active:
        return []
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
