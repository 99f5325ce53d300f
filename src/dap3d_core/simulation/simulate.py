"""The door to a run."""

import os
from collections.abc import Callable, Sequence

from dap3d_core.result import Result
from dap3d_core.scene import Scene
from dap3d_core.simulation.asked import check_checkpoint, compiled_for, settings_of
from dap3d_core.simulation.compiled import CompiledModel
from dap3d_core.simulation.event import Event
from dap3d_core.simulation.run import Progress, Run
from dap3d_core.simulation.standing import Standing


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

    What is left out is the scene's [simulation]'s, by default method "auto", integrator "dop853",
    rtol 1e-8, atol 1e-10, correct and project on.

    Args:
        scene: a Scene, what ``load`` takes, or a model that was compiled before.
        t_end: final time, s; 0 solves once at t = 0.
        dt: reporting step, s; by default t_end / 100. t_end is reported in any case.
        method: "auto", "unconstrained", "standard", "penalty" or "lsq".
        integrator: "dopri5", "dop853", "adams", "rk4" (needs ``step``), "radau" (implicit), "auto".
        rtol, atol, step: tolerances of the step's error; a fixed step, s, without error control.
        correct, project: bring the start, and then every state, onto the constraints.
        progress: called as progress(t, t_end) between chunks of some 0.1 s.
        allow_code, announce: as ``compile`` has them.
        output, force: file to write, and whether over an existing one. While a run of more than a
            second goes on its rows stand in ``NAME.part``, synced: readable also when it is killed.
        correct_metric: "unit" or "mass": the least correction in m and rad, or by masses.
        estimate_error: estimate ``result.error`` by a second, finer run.
        checkpoint: seconds between two checkpoints in ``OUTPUT.checkpoint``, from which ``resume``
            goes on; one is written, too, where an exception ends the run between two chunks, and
            none is left by a run that ends by itself. inf: only then. Needs ``output``.
        events: what to look out for (``Event``).
        watch: called between chunks with how the run stands: t, t_end, steps, step, energy drift.

    Returns:
        the result. Any exception that ends the integration carries what was computed until then as
        ``.result``; KeyboardInterrupt and those of ``progress``, ``watch`` come out as they are.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; settings or an output that won't do.
        RedundantError, AssemblyError: dependent constraints; positions that cannot be assembled.
        SimulationError: the run stopped; ``.result`` is what was computed.
    """
    compiled = compiled_for(scene, method, allow_code, announce)
    settings = settings_of(compiled, t_end=t_end, dt=dt, method=method, integrator=integrator,
                         rtol=rtol, atol=atol, step=step, correct=correct, project=project,
                         correct_metric=correct_metric)  # fmt: skip
    check_checkpoint(checkpoint, output)
    run = Run(compiled, settings, announce, events, watch)
    return run.go(
        progress, output, force=force, estimate_error=estimate_error, checkpoint=checkpoint
    )
