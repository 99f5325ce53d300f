"""Commands: common options, checks of the command line, failures as messages and exit codes."""

from collections.abc import Callable
from typing import Any

import click

from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.memory import check_memory
from dap3d_core.cli.process.signals import SignalHandler
from dap3d_core.cli.process.streams import prints_json, stdout_fault

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
        make = click.command(name, cls=Command, short_help=short_help, saves=saves)
        return make(function)

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
