"""The application ``dap3d``: its commands, each imported when it is used.

Nothing here imports numpy, scipy, llvmlite, matplotlib, netCDF4 or rich: commands do that.
"""

import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from importlib import import_module
from typing import Any

import click

from dap3d_core.cli.framework.command import DEBUG, NO_COLOR
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.streams import leave_stdout, prepare_streams, reserve_stdout_for_json

#: Modules of the commands, which have the same names, in the order in which a user meets them.
COMMANDS = {
    name: f"dap3d_core.cli.commands.{name.replace('-', '_')}"
    for name in (
        "run", "resume", "rerun", "equilibrium", "kinematics", "inverse", "modes", "response",
        "sensitivities", "sweep", "check", "models", "plugins", "describe", "new-plugin",
        "check-plugin", "info", "post", "export", "plot", "animate", "view", "report",
        "import-matlab",
    )
} | {"import": "dap3d_core.cli.commands.import_model"}  # fmt: skip

#: What else a command is called, as in Python or in other programs.
SYNONYMS = {
    "simulate": "run", "continue": "resume", "repeat": "rerun", "linearize": "modes",
    "linearise": "modes", "eigenvalues": "modes", "bode": "response",
    "gradients": "sensitivities", "validate": "check", "list": "models",
    "open": "info", "help": "--help",
}  # fmt: skip


class _Commands(Mapping[str, click.Command]):
    """The commands by name, imported on access."""

    def __getitem__(self, name: str) -> click.Command:
        module = COMMANDS[name]
        return getattr(import_module(module), module.rpartition(".")[2])

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class App(click.Group):
    """The group of commands; suggests the right spelling of a command."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order of the table."""
        return list(COMMANDS)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; suggest the nearest one for a misspelt name."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            from dap3d_core.registry.suggestions import nearest

            near = SYNONYMS.get(name) or nearest(name, list(COMMANDS))
            hint = f"did you mean {near!r}?" if near else f"commands: {', '.join(COMMANDS)}"
            raise click.UsageError(f"there is no command {name!r}; {hint}", ctx)
        return super().resolve_command(ctx, args)


@click.group(
    cls=App,
    commands=_Commands(),
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="dap3d", prog_name="dap3d")
@DEBUG
@NO_COLOR
def dap3d(debug: bool) -> None:
    """Simulate the motion of rigid bodies joined by joints, springs and drivers.

    \b
    dap3d models                  list the shipped models
    dap3d run pen1                simulate, write pen1.nc
    dap3d plot pen1.nc cone.r.z   draw a curve of it
    dap3d view pen1.nc --open     look at the moving scene

    MODEL is the name of a shipped model, a folder with a scene.toml, or a TOML file. RESULT is a
    file that run wrote.

    Exit codes: 0 done; 1 failed, nothing to keep; 2 wrong usage or mistakes in the scene; 3 stopped
    early, what was computed is saved; 130 interrupted, what was computed is saved.
    """


def run_line(argv: Sequence[str] | None) -> int:
    """Run a command line, by default that of the process; returns the exit code."""
    prepare_streams()
    words = list(sys.argv[1:] if argv is None else argv)
    options = words[: words.index("--")] if "--" in words else words
    as_json = "--json" in options and not {"-h", "--help", "--version"} & set(options)
    stdout = reserve_stdout_for_json(permanently=argv is None) if as_json else nullcontext()
    with warnings.catch_warnings(), stdout:
        warnings.showwarning = _show_warning
        return _run_words(words, as_json=as_json)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning of a library, which may quote a name of a scene, as any other message."""
    from dap3d_core.cli.console.console import stderr

    stderr().say(f"warning: {message}", "yellow", whole=True)


def _run_words(words: list[str], *, as_json: bool) -> int:
    try:
        code = dap3d.main(args=words, prog_name="dap3d", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        _report_usage(error, as_json=as_json)
        return error.exit_code
    except click.exceptions.Abort:  # Ctrl-C before a command has begun
        print("interrupted", file=sys.stderr)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe
        leave_stdout()
        return exit_codes.DONE
    except MemoryError:  # too little even for the modules that report errors
        print("there is not enough memory for this", file=sys.stderr)
        return exit_codes.FAILED
    except OSError as error:
        leave_stdout()
        print(f"cannot write the output: {error.strerror or error}", file=sys.stderr)
        return exit_codes.FAILED
    return code if isinstance(code, int) else exit_codes.DONE


def _report_usage(error: click.ClickException, *, as_json: bool) -> None:
    from dap3d_core.cli.console.console import print_json, stderr

    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        error.show()
        return
    if as_json:
        print_json({"error": error.format_message(), "exit_code": error.exit_code})
    console = stderr()
    ctx = getattr(error, "ctx", None)
    if ctx is not None:
        click.echo(ctx.get_usage(), err=True)
        console.say(f"Try '{ctx.command_path} --help' for help.\n")
    console.say(f"Error: {error.format_message()}", "red")
