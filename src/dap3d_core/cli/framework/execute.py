"""Carrying out a run for a command: progress, signals, and what is kept when it ends early."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused, Terminated

if TYPE_CHECKING:
    from dap3d_core.cli.console.run_outcome import Outcome
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel, Standing

    Announce = Callable[[str], None]
    Watch = Callable[[Standing], None]


def carry_out(
    ctx: click.Context,
    prepare: "Callable[[Announce], CompiledModel]",
    go: "Callable[[Announce, Watch], Result]",
    *,
    quiet: bool,
) -> "Outcome":
    """Compile a model and run it; a run that ends early gives what it computed.

    Args:
        ctx: of the command.
        prepare: compiles the model.
        go: runs it.
        quiet: whether no progress is shown.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import RunProgress
    from dap3d_core.cli.console.run_outcome import Outcome

    stopping = ctx.meta["dap3d.stopping"]
    with RunProgress(quiet=quiet) as progress:

        def watch(standing: "Standing") -> None:
            progress.advance(standing)
            stopping.between_chunks()

        try:
            compiled = prepare(progress.announce)
        except dap.SimulationError as error:  # a method that does not fit the scene
            raise Refused(str(error)) from error
        progress.start()
        try:
            result = go(progress.announce, watch)
        except (Exception, KeyboardInterrupt) as error:
            kept, code, reason = what_is_left(ctx, error)
            return Outcome(compiled, kept, code, reason, getattr(error, "checkpoint", None))
        return Outcome(compiled, result, exit_codes.DONE, "", None)


def what_is_left(ctx: click.Context, error: BaseException) -> tuple[Any, int, str]:
    """What was computed until an exception, the exit code, the reason.

    Raises:
        BaseException: the same exception, where it has nothing to keep.
    """
    kept = getattr(error, "result", None)
    if kept is None:
        raise error
    if ctx.meta["dap3d.debug"]:
        import traceback

        traceback.print_exception(error)
    return (kept, *ending(error))


def ending(error: BaseException) -> tuple[int, str]:
    """Exit code and reason of what ended early and left something to keep."""
    from dap3d_core.result import ResultError
    from dap3d_core.simulation import SimulationError

    if isinstance(error, KeyboardInterrupt):
        return exit_codes.INTERRUPTED, "interrupted"
    if isinstance(error, (SimulationError, ResultError, Terminated)):
        return exit_codes.PARTIAL, str(error)
    return exit_codes.PARTIAL, f"{type(error).__name__}: {error} (--debug shows where)"


class Seconds(click.ParamType):  # type: ignore[type-arg]
    """A time as people write it: 90, 90s, 5min, 2h; in s."""

    name = "time"
    _UNITS = (("min", 60.0), ("s", 1.0), ("h", 3600.0), ("", 1.0))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number of seconds."""
        import math

        if isinstance(value, float):
            return value
        unit, factor = next((u, f) for u, f in self._UNITS if value.endswith(u))
        try:
            found = float(value.removesuffix(unit)) * factor
        except ValueError:
            found = math.nan
        if not 0.0 < found < math.inf:
            self.fail(f"{value!r} is no time; write 90, 90s, 5min or 2h", param, ctx)
        return found
