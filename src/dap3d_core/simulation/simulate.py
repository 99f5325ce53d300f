"""Public function ``simulate``."""

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Unpack

from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result
from dap3d_core.scene import Scene
from dap3d_core.settings import RunSettings
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.events.event import Event
from dap3d_core.simulation.output.monitor import RunProgress
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks, Progress
from dap3d_core.simulation.settings import (
    check_checkpoint,
    compiled_for,
    replaced_notes,
    settings_of,
)

if TYPE_CHECKING:
    from dap3d_core.simulation.control.sampled import Controller
    from dap3d_core.simulation.initial.start_state import Start, StartState


@checked
def simulate(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    start: "Start | None" = None,
    estimate_error: bool | str = False,
    checkpoint: float | None = None,
    events: Sequence[Event] = (),
    watch: Callable[[RunProgress], None] | None = None,
    controllers: "Sequence[Controller]" = (),
    **settings: Unpack[RunSettings],
) -> Result:
    """Simulate a scene from t = 0 to t_end; settings left out are those of its [simulation].

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model; allow_code, announce: as there.
        t_end, dt: final time, s (0 solves once); reporting step, by default t_end / 100.
        method: "auto", "unconstrained", "standard", "penalty", "lsq" or "joint".
        integrator: "dopri5", "dop853", "adams", "rk4" (needs ``step``), "radau" (implicit), "auto".
        rtol, atol, step: tolerances of the step's error; a fixed step, s, without error control.
        correct, correct_metric, project: bring the start onto the constraints, by the least change
            in m and rad ("unit") or weighted by masses ("mass"), and then every state.
        start: "scene", "equilibrium", a result (its end), (result, time) or an ``Equilibrium``.
        progress, watch: called each 0.1 s or so, as progress(t, t_end), with a ``RunProgress``.
        events, controllers: see ``Event``, ``Controller``.
        contact, contact_step: "events", "stepping" or "auto"; step of stepping, s.
        output, force: file to write, ``OUTPUT.part`` meanwhile; whether over an existing one.
        estimate_error: of ``result.error`` by a second, finer run; "quick": if within 1 s.
        checkpoint: seconds between checkpoints, for ``resume``; inf: one where the run is ended.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; unusable settings or output.
        SimulationError (RedundantError, AssemblyError): the run stopped, with ``.result``.
    """
    compiled = compiled_for(scene, allow_code, announce, **settings)
    simulation = settings_of(compiled, start=start_word(start), **settings)
    check_checkpoint(checkpoint, output)
    with compiled.borrow_evaluator():
        callbacks = Callbacks(progress=progress, watch=watch)
        run = Run(compiled, simulation, callbacks, events,
                  output=output, force=force, estimate_error=estimate_error,
                  start=given_state(start, compiled), controllers=controllers)  # fmt: skip
        run.notes += replaced_notes(compiled, simulation, settings)
        if checkpoint is not None:
            run.save_every(checkpoint, force=force)
        return run.execute()


def start_word(start: "Start | None") -> str | None:
    """The setting ``start`` where that is given; None where a state is, or nothing."""
    return start if isinstance(start, str) else None


def given_state(start: "Start | None", compiled: CompiledModel) -> "StartState | None":
    """A state in place of the scene's; None where the settings say where a run starts."""
    if start is None or isinstance(start, str):
        return None
    from dap3d_core.simulation.initial.start_state import start_state

    return start_state(start, compiled.model, compiled.checked)
