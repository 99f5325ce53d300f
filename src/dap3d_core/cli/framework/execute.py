"""Runs of a command: progress, signals, and what is saved when a run ends early."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework.command import signals_of
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Terminated, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.run_summary import RunOutcome
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel, RunProgress

    Announce = Callable[[str], None]
    Watch = Callable[[RunProgress], None]


def execute(
    ctx: click.Context,
    prepare: "Callable[[Announce], CompiledModel]",
    run: "Callable[[Announce, Watch], Result]",
    *,
    quiet: bool,
) -> "RunOutcome":
    """Compile a model and run it; a run that ends early returns what it computed."""
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import ProgressBar
    from dap3d_core.cli.console.run_summary import RunOutcome

    with ProgressBar(quiet=quiet) as progress:
        with refusing(dap.SimulationError):  # a method that does not fit the scene
            compiled = prepare(progress.announce)
        progress.start()
        try:
            result = run(progress.announce, signals_of(ctx).interruptible(progress.advance))
        except (Exception, KeyboardInterrupt) as error:
            partial, code, reason = partial_result(ctx, error)
            return RunOutcome(compiled, partial, code, reason, getattr(error, "checkpoint", None))
        return RunOutcome(compiled, result, exit_codes.DONE, "", None)


def partial_result(ctx: click.Context, error: BaseException) -> tuple[Any, int, str]:
    """The result until an exception, the exit code and the reason.

    Raises:
        BaseException: the same exception if it carries no result.
    """
    from dap3d_core.result import ResultError
    from dap3d_core.simulation import SimulationError

    result = getattr(error, "result", None)
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
