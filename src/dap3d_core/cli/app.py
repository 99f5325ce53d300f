"""The group ``dap3d``: its commands, and what all of them have in common.

Nothing here imports numpy, scipy, llvmlite, matplotlib, netCDF4 or rich: commands do that.
"""

import sys
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import click

from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.signals import Stopping
from dap3d_core.cli.process.streams import json_alone, leave_stdout, prepare_streams, stdout_fault


def _drop_colors(ctx: click.Context, option: click.Parameter, asked: bool) -> None:
    """From now on, also for the commands of this context: no colour."""
    if asked:
        ctx.find_root().color = ctx.color = False


def _no_color() -> click.Option:
    return click.Option(
        ["--no-color"], is_flag=True, is_eager=True, expose_value=False, callback=_drop_colors,
        help="Print without colours, as with NO_COLOR=1 in the environment.",
    )  # fmt: skip


class Command(click.Command):
    """A command with ``--debug``; its failures become messages and exit codes.

    Attributes:
        saves: whether what it makes is a file, with or without ``--output``; what it prints tells
            of it alone.

    An option that is given twice is refused, for taking the last one would be a quiet choice; so is
    an empty word, which comes from a variable of a shell that was not set.
    """

    def __init__(self, *args: Any, saves: bool = False, **options: Any) -> None:
        super().__init__(*args, **options)
        self.saves = saves
        self.params.append(
            click.Option(["--debug"], is_flag=True, help="Show the traceback of a failure.")
        )
        self.params.append(_no_color())

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, and refuse options that are given twice, and empty words."""
        ctx.meta["dap3d.words"] = tuple(args)
        if not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(args=list(args))
            for option in order:
                once = isinstance(option, click.Option) and not option.multiple
                if once and order.count(option) > 1:
                    words = f"the option {' / '.join(option.opts)} is given more than once"
                    raise click.UsageError(words, ctx)
        rest = super().parse_args(ctx, args)
        for param in self.params:
            value = ctx.params.get(param.name or "")
            if value == "" or (isinstance(value, tuple) and "" in value):
                raise click.UsageError(f"{param.get_error_hint(ctx)} is an empty word", ctx)
        return rest

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; whatever it raises is reported and becomes an exit code."""
        debug = ctx.params.pop("debug") or bool(ctx.find_root().params.get("debug"))
        ctx.meta["dap3d.debug"] = debug
        try:
            with Stopping() as stopping:
                ctx.meta["dap3d.stopping"] = stopping
                return self._told(ctx, super().invoke(ctx))
        except (click.ClickException, click.exceptions.Exit):
            raise
        except (Exception, KeyboardInterrupt) as error:
            from dap3d_core.cli.framework.error_messages import report

            ctx.exit(report(error, debug=debug, as_json=bool(ctx.params.get("as_json"))))

    def _told(self, ctx: click.Context, code: int) -> int:
        """The exit code of a command that has ended; of one whose words were lost it is said so."""
        if not (fault := stdout_fault()):
            return code
        from dap3d_core.cli.console.console import messages, say

        saves = ctx.params.get("output") is not None or self.saves
        words = "; the files of the command are saved" if saves else ""
        say(messages(), f"cannot write to the standard output: {fault}{words}", "bold red")
        return code if saves else code or exit_codes.FAILED


class Group(click.Group):
    """The group, which knows the right spelling of a command."""

    command_class = Command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; suggest the nearest where there is none."""
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            from dap3d_core.registry.suggestions import nearest

            commands = self.list_commands(ctx)
            near = nearest(name, commands)
            hint = f"did you mean {near!r}?" if near else f"commands: {', '.join(commands)}"
            raise click.UsageError(f"there is no command {name!r}; {hint}", ctx)
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """In the order in which one meets them."""
        return list(self.commands)


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="dap3d", prog_name="dap3d")
@click.option("--debug", is_flag=True, help="Show the traceback of a failure.")
def dap3d(debug: bool) -> None:
    """Simulate the motion of rigid bodies joined by joints, springs and drivers.

    \b
    dap3d models                  what there is to try
    dap3d run pen1                simulate, write pen1.nc
    dap3d plot pen1.nc cone.r.z   draw a curve of it
    dap3d view pen1.nc --open     look at the moving scene

    MODEL is the name of a shipped model, a folder with a scene.toml, or a TOML file. RESULT is a
    file that run wrote.

    Exit codes: 0 done; 1 failed, nothing to keep; 2 wrong usage or mistakes in the scene; 3 stopped
    early, what was computed is saved; 130 interrupted, what was computed is saved.
    """


dap3d.params.append(_no_color())


def run_line(argv: Sequence[str] | None) -> int:
    """Run the words of a command line, by default those of the process; returns the exit code."""
    prepare_streams()
    words = list(sys.argv[1:] if argv is None else argv)
    options = words[: words.index("--")] if "--" in words else words
    as_json = "--json" in options and not {"-h", "--help", "--version"} & set(options)
    alone = json_alone(to_the_end=argv is None) if as_json else nullcontext()
    with warnings.catch_warnings(), alone:
        warnings.showwarning = _tell_warning
        return _run_words(words, as_json=as_json)


def _tell_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """A warning of a library, which may quote a name of a scene, as any other message."""
    from dap3d_core.cli.console.console import messages, say

    say(messages(), f"warning: {message}", "yellow", whole=True)


def _run_words(words: list[str], *, as_json: bool) -> int:
    try:
        code = dap3d.main(args=words, prog_name="dap3d", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        _tell_usage(error, as_json=as_json)
        return error.exit_code
    except click.exceptions.Abort:  # Ctrl-C, as click has it, before a command has begun
        print("interrupted", file=sys.stderr)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:  # the reader has seen enough
        leave_stdout()
        return exit_codes.DONE
    except OSError as error:
        leave_stdout()
        print(f"cannot write the output: {error.strerror or error}", file=sys.stderr)
        return exit_codes.FAILED
    return code if isinstance(code, int) else exit_codes.DONE


def _tell_usage(error: click.ClickException, *, as_json: bool) -> None:
    from dap3d_core.cli.console.console import messages, print_json, say

    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        error.show()
        return
    if as_json:
        print_json({"error": error.format_message(), "exit_code": error.exit_code})
    console = messages()
    ctx = getattr(error, "ctx", None)
    if ctx is not None:
        click.echo(ctx.get_usage(), err=True)
        say(console, f"Try '{ctx.command_path} --help' for help.\n")
    say(console, f"Error: {error.format_message()}", "red")


def _add_commands() -> None:
    from dap3d_core.cli.commands.animate import animate
    from dap3d_core.cli.commands.check import check
    from dap3d_core.cli.commands.check_plugin import check_plugin
    from dap3d_core.cli.commands.describe import describe
    from dap3d_core.cli.commands.export import export
    from dap3d_core.cli.commands.import_matlab import import_matlab
    from dap3d_core.cli.commands.info import info
    from dap3d_core.cli.commands.models import models
    from dap3d_core.cli.commands.new_plugin import new_plugin
    from dap3d_core.cli.commands.plot import plot
    from dap3d_core.cli.commands.plugins import plugins
    from dap3d_core.cli.commands.post import post
    from dap3d_core.cli.commands.report import report
    from dap3d_core.cli.commands.rerun import rerun
    from dap3d_core.cli.commands.resume import resume
    from dap3d_core.cli.commands.run import run
    from dap3d_core.cli.commands.sweep import sweep
    from dap3d_core.cli.commands.view import view

    analysis = (info, post, export, plot, animate, view, report)
    authors = (describe, new_plugin, check_plugin)
    runs = (run, resume, rerun, sweep)
    for command in (*runs, check, models, plugins, *authors, *analysis, import_matlab):
        dap3d.add_command(command)


_add_commands()
