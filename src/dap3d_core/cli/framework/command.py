"""Commands: common options, checks of the command line, signals, failures and their exit codes."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import click

from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Terminated
from dap3d_core.cli.process.memory import check_memory
from dap3d_core.cli.process.streams import prints_json, stdout_fault

#: Seconds after which a signal that was swallowed is sent again.
AGAIN = 0.05
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class SignalHandler:
    """Context manager in which signals end a command in an orderly way.

    A signal raises at once: KeyboardInterrupt for Ctrl-C, ``Terminated`` for others. After the
    first ``raise_pending`` it waits for the next one, so that no chunk of a run is lost; a second
    signal does not wait. A signal that is swallowed by a callback of a C library (the compiler's,
    for example) is sent again a moment later.
    """

    def __init__(self) -> None:
        self._pending: int | None = None
        self._waits = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "SignalHandler":
        for name in _NAMES:
            number = getattr(signal, name, None)
            if number is None or signal.getsignal(number) is signal.SIG_IGN:  # as nohup sets it
                continue
            try:
                self._before[number] = signal.signal(number, self._handle)
            except ValueError:  # not the main thread, which alone may handle signals
                break
        self._hook, sys.unraisablehook = sys.unraisablehook, self._resend
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        sys.unraisablehook = self._hook
        for number, before in self._before.items():
            signal.signal(number, before)
        # A package interrupted in its import may catch the interrupt and fail later for another
        # reason.
        if self._pending is not None and not self._waits and isinstance(error, Exception):
            raise _exception(self._pending) from error

    def raise_pending(self) -> None:
        """Raise the exception of a pending signal; later signals wait for this call."""
        self._waits = True
        pending, self._pending = self._pending, None
        if pending is not None:
            raise _exception(pending)

    def interruptible(self, callback: Callable[..., None]) -> Callable[..., None]:
        """A callback of a run that raises pending signals after each call."""

        def call(*arguments: Any) -> None:
            callback(*arguments)
            self.raise_pending()

        return call

    def _resend(self, lost: "sys.UnraisableHookArgs") -> None:
        if isinstance(lost.exc_value, (KeyboardInterrupt, Terminated)):
            number = self._pending or signal.SIGINT
            again = threading.Timer(AGAIN, _thread.interrupt_main, [number])
            again.daemon = True
            again.start()
        else:
            self._hook(lost)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        waits = self._waits and self._pending is None
        self._pending = number
        if not waits:
            raise _exception(number)


def _exception(number: int) -> BaseException:
    if number == signal.SIGINT:
        return KeyboardInterrupt()
    return Terminated(f"ended by {signal.Signals(number).name}")


#: Decorator that adds an option or an argument to a function.
Option = Callable[[Callable[..., Any]], Any]


def _drop_colors(ctx: click.Context, option: click.Parameter, given: bool) -> None:
    if given:
        ctx.find_root().color = ctx.color = False


DEBUG = click.option("--debug", is_flag=True, help="Show the traceback of a failure.")
NO_COLOR = click.option(
    "--no-color", is_flag=True, is_eager=True, expose_value=False, callback=_drop_colors,
    help="Print without colours, as with NO_COLOR=1 in the environment.",
)  # fmt: skip


def command(
    short_help: str, *options: Option, saves: bool = False, name: str | None = None
) -> Callable[[Callable[..., int]], "Command"]:
    """Decorator that turns a function into the command of its name.

    Args:
        short_help: its line in the list of commands.
        options: in the order of its help; ``--debug`` and ``--no-color`` follow.
        saves: see ``Command``.
        name: of the command, where it is no name of a function.
    """

    def decorate(function: Callable[..., int]) -> Command:
        for option in reversed((*options, DEBUG, NO_COLOR)):
            function = option(function)
        return click.command(name, cls=Command, short_help=short_help, saves=saves)(function)

    return decorate


def signals_of(ctx: click.Context) -> SignalHandler:
    """The signal handler of a running command."""
    return ctx.meta["dap3d.signals"]


class Command(click.Command):
    """A command with ``--debug``; its failures become messages and exit codes.

    Options given twice are refused, because using the last one would be a silent choice; so are
    empty words, which come from unset variables of a shell.

    Attributes:
        saves: True if the command writes files without ``--output`` too: they are its result, and
            losing what it prints is no failure.
    """

    def __init__(self, *args: Any, saves: bool = False, **options: Any) -> None:
        super().__init__(*args, **options)
        self.saves = saves

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, and refuse options that are given twice, and empty words."""
        ctx.meta["dap3d.words"] = tuple(args)
        if not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(args=list(args))
            for option in order:
                once = isinstance(option, click.Option) and not option.multiple
                if once and order.count(option) > 1:
                    names = " / ".join(option.opts)
                    raise click.UsageError(f"the option {names} is given more than once", ctx)
        rest = super().parse_args(ctx, args)
        for param in self.params:
            value = ctx.params.get(param.name or "")
            if value == "" or (isinstance(value, tuple) and "" in value):
                hint = param.get_error_hint(ctx).replace("[", "").replace("]", "")
                raise click.UsageError(f"{hint} is empty", ctx)
        return rest

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; what it raises is reported and becomes an exit code."""
        debug = ctx.params.pop("debug") or bool(ctx.find_root().params.get("debug"))
        ctx.meta["dap3d.debug"] = debug
        for name in ("as_json", "quiet"):
            ctx.meta[f"dap3d.{name}"] = ctx.params.pop(name, False)
        try:
            with SignalHandler() as signals:
                ctx.meta["dap3d.signals"] = signals
                check_memory()
                return self._report_lost_output(ctx, super().invoke(ctx))
        except (click.ClickException, click.exceptions.Exit):
            raise
        except (Exception, KeyboardInterrupt) as error:
            from dap3d_core.cli.framework.error_messages import report_error

            ctx.exit(report_error(error, debug=debug, as_json=prints_json()))

    def _report_lost_output(self, ctx: click.Context, code: int) -> int:
        """The exit code of a finished command, after a message if its output was lost."""
        if not (fault := stdout_fault()):
            return code
        from dap3d_core.cli.console.console import stderr

        saves = ctx.params.get("output") is not None or self.saves
        saved = "; the files of the command are saved" if saves else ""
        stderr().say(f"cannot write to the standard output: {fault}{saved}", "bold red")
        return code if saves else code or exit_codes.FAILED
