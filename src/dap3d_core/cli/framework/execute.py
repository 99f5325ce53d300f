"""Runs of a command: progress, signals, and what is saved when a run ends early."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework.command import signals_of
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Terminated, refusing
from dap3d_core.cli.process.streams import is_quiet

if TYPE_CHECKING:
    from pathlib import Path

    from dap3d_core.cli.console.run_summary import RunOutcome
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene
    from dap3d_core.simulation import CompiledModel, RunProgress

    Announce = Callable[[str], None]
    Watch = Callable[[RunProgress], None]


def execute_scene(
    ctx: click.Context,
    scene: "Scene",
    model: str,
    target: "Path",
    run: "Callable[[CompiledModel, Announce, Watch], Result]",
    options_of: Mapping[str, str],
    *,
    strict: bool,
    allow_code: bool,
    method: str | None = "auto",
) -> int:
    """Compile the scene of a model, run it as ``execute``, and report; returns the exit code.

    Args:
        options_of: argument of ``run`` -> option, for mistakes that only the run can see.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.run_summary import report_run
    from dap3d_core.cli.framework.options import in_options

    def prepare(announce: "Announce") -> "CompiledModel":
        return dap.compile(scene, method=method, allow_code=allow_code, announce=announce)

    def named(compiled: "CompiledModel", announce: "Announce", watch: "Watch") -> "Result":
        try:
            return run(compiled, announce, watch)
        except dap.SceneError as error:
            raise in_options(error, options_of) from error

    return report_run(execute(ctx, prepare, named), model, target, strict=strict)


def progress_of(watch: "Watch") -> Callable[[float, float], None]:
    """Progress by time alone, of what takes no steps of integration."""
    from dap3d_core.simulation import RunProgress

    return lambda t, t_end: watch(RunProgress(t, t_end, 0, 0.0, 0.0))


def execute(
    ctx: click.Context,
    prepare: "Callable[[Announce], CompiledModel]",
    run: "Callable[[CompiledModel, Announce, Watch], Result]",
) -> "RunOutcome":
    """Compile a model and run it; a run that ends early returns what it computed."""
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import ProgressBar
    from dap3d_core.cli.console.run_summary import RunOutcome
    from dap3d_core.result import Computed

    with ProgressBar(quiet=is_quiet()) as progress:
        with refusing(dap.SimulationError):  # a method that does not fit the scene
            compiled = prepare(progress.announce)
        progress.start()
        try:
            watch = signals_of(ctx).interruptible(progress.advance)
            result = run(compiled, progress.announce, watch)
        except (Exception, KeyboardInterrupt) as error:
            partial, code, reason = partial_result(ctx, error)
            return RunOutcome(compiled, partial, code, reason, Computed.of(error).checkpoint)
        return RunOutcome(compiled, result, exit_codes.DONE, "", None)


def partial_result(ctx: click.Context, error: BaseException) -> tuple[Any, int, str]:
    """The result until an exception, the exit code and the reason.

    Raises:
        BaseException: the same exception if it carries no result.
    """
    from dap3d_core.result import Computed, ResultError
    from dap3d_core.simulation import SimulationError

    result = Computed.of(error).result
    if result is None:
        raise error
    if ctx.meta["dap3d.debug"]:
        import traceback

        traceback.print_exception(error)
    if isinstance(error, KeyboardInterrupt):
        return result, exit_codes.INTERRUPTED, "interrupted"
    if isinstance(error, (SimulationError, ResultError, Terminated)):
        return result, exit_codes.PARTIAL, str(error)
    reason = f"{type(error).__name__}: {error} (--debug shows where)"
    return result, exit_codes.PARTIAL, reason
