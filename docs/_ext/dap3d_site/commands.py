"""Reference of the command line: a section for each command, from the command itself."""

import inspect
import re
from collections.abc import Iterator
from typing import Any

import click

from dap3d_core.cli.app import dap3d
from dap3d_core.cli.process import exit_codes
from dap3d_site.markdown import code, fenced, page, table

#: Lines that are set as they stand begin with this mark of click.
AS_IT_STANDS = "\b"


def pages() -> Iterator[tuple[str, str]]:
    """The page of the command line: (path, text)."""
    yield "reference/command-line.md", page("Command line", *_group(), *_commands())


def _group() -> Iterator[str]:
    yield prose(dap3d.help)
    yield options(dap3d)
    codes = [
        (str(value), name.lower()) for name, value in vars(exit_codes).items() if name.isupper()
    ]
    yield "Names of the exit codes: " + ", ".join(f"{n} {code(name)}" for n, name in codes) + "."


def _commands() -> Iterator[str]:
    for name, command in dap3d.commands.items():
        yield f"## dap3d {name}"
        context = click.Context(
            command, info_name=name, parent=click.Context(dap3d, info_name="dap3d")
        )
        yield fenced(
            f"{context.command_path} {' '.join(command.collect_usage_pieces(context))}", "text"
        )
        yield prose(command.help)
        yield options(command)


def prose(text: str | None) -> str:
    """The help of a command: paragraphs, and blocks that are set as they stand."""
    paragraphs = re.split(r"\n\s*\n", inspect.cleandoc(text or ""))
    return "\n\n".join(
        fenced(p.replace(AS_IT_STANDS, "").lstrip("\n"), "text") if AS_IT_STANDS in p else p
        for p in paragraphs
    )


def options(command: click.Command) -> str:
    """The table of the options of a command, --help and --version left out."""
    rows = [(_written(p), _help(p)) for p in command.params if isinstance(p, click.Option)
            and p.name != "version"]  # fmt: skip
    return table(("option", "does"), rows)


def _written(option: click.Option) -> str:
    words = [*option.opts, *option.secondary_opts]
    if not option.is_flag:
        words[-1] += f" {option.metavar or _choices(option.type) or option.type.name.upper()}"
    return ", ".join(code(word) for word in words)


def _choices(type_: Any) -> str:
    return "|".join(getattr(type_, "choices", ()))


def _help(option: click.Option) -> str:
    if not option.help:
        raise LookupError(f"the option {option.opts} has no help")
    return option.help
