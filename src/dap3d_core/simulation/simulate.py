"""The door to a run."""

import os
from collections.abc import Callable, Sequence

from dap3d_core.result import Result
from dap3d_core.scene import Scene
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.events.event import Event
from dap3d_core.simulation.output.monitor import Standing
from dap3d_core.simulation.run import Progress, Run
from dap3d_core.simulation.settings import check_checkpoint, compiled_for, settings_of


def simulate(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    integrator: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    correct: bool | None = None,
    project: bool | None = None,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    correct_metric: str | None = None,
    estimate_error: bool = False,
    checkpoint: float | None = None,
    events: Sequence[Event] = (),
    watch: Callable[[Standing], None] | None = None,
) -> Result:
    """Simulate a scene from t = 0 to t_end.

    What is left out is the scene's [simulation]'s, else as ``Simulation`` has it.

    Args:
        scene: a Scene, what ``load`` takes, or a model that was compiled before.
        t_end, dt: final time, s (0 solves once at t = 0); reporting step, by default t_end / 100.
        method: "auto", "unconstrained", "standard", "penalty" or "lsq".
        integrator: "dopri5", "dop853", "adams", "rk4" (needs ``step``), "radau" (implicit), "auto".
        rtol, atol, step: tolerances of the step's error; a fixed step, s, without error control.
        correct, project: bring the start, and then every state, onto the constraints.
        progress: called as progress(t, t_end) between chunks of some 0.1 s.
        allow_code, announce: as ``compile`` has them. events: what to look out for (``Event``).
        output, force: file to write, and whether over an existing one. Rows of a run of more than
            a second stand in ``OUTPUT.part`` meanwhile, readable also when it is killed.
        correct_metric: "unit" or "mass": least correction in m and rad, or by masses.
        estimate_error: estimate ``result.error`` by a second, finer run.
        checkpoint: seconds between checkpoints in ``OUTPUT.checkpoint``, for ``resume``; inf: only
            where an exception (Ctrl-C, one of ``progress``) ends the run. Needs ``output``.
        watch: called between chunks with how the run stands (``Standing``).

    Returns:
        the result. An exception that ends the integration carries what was computed as ``.result``.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; settings or an output that won't do.
        SimulationError (RedundantError, AssemblyError): the run stopped, or could not begin.
    """
    compiled = compiled_for(scene, method, allow_code, announce)
    settings = settings_of(compiled, t_end=t_end, dt=dt, method=method, integrator=integrator,
                         rtol=rtol, atol=atol, step=step, correct=correct, project=project,
                         correct_metric=correct_metric)  # fmt: skip
    check_checkpoint(checkpoint, output)
    with compiled.in_use():
        run = Run(compiled, settings, announce, events, watch, estimate_error=estimate_error)
        return run.go(progress, output, force=force, checkpoint=checkpoint)
