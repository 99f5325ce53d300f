"""Consoles, and the few shapes that all output takes: paragraphs, facts, tables, JSON.

Text is plain where it goes to a file or another program. What was asked for is wrapped at 80
columns then; messages keep their lines, for programs that look for places in them.
"""

import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import click
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from dap3d_core.cli.process.streams import json_stream, leave_stderr, leave_stdout

#: Bits of an integer; Python refuses to write the decimal digits of some 14000.
LONGEST_INTEGER = 4096


class Terminal(Console):
    """A console without markup, which goes quiet when its reader has gone or its disk is full."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(
            stderr=stderr, markup=False, highlight=False, emoji=False, no_color=_without_colors()
        )

    def _check_buffer(self) -> None:
        try:
            super()._check_buffer()
        except OSError as error:
            self._leave(error)

    def on_broken_pipe(self) -> None:
        """Write nothing any more; the command goes on to its end."""
        self._leave(None)

    def _leave(self, error: OSError | None) -> None:
        self.quiet = True
        if self.stderr:
            leave_stderr()
        else:
            leave_stdout(error)

    @property
    def wraps(self) -> bool:
        """Whether lines are wrapped: but for messages that go elsewhere than to a terminal."""
        return not self.stderr or self.has_width

    @property
    def has_width(self) -> bool:
        """Whether there is a width to keep: on a terminal, or where one is given."""
        return self.is_terminal or "COLUMNS" in os.environ


def _without_colors() -> bool | None:
    """True where ``--no-color`` was given; None leaves it to the environment (NO_COLOR)."""
    ctx = click.get_current_context(silent=True)
    return True if ctx is not None and ctx.color is False else None


def output() -> Terminal:
    """The console of what a command was asked for."""
    return Terminal()


def messages() -> Terminal:
    """The console of everything else: errors, progress."""
    return Terminal(stderr=True)


def say(
    console: Terminal, words: str, style: str = "", indent: int = 0, *, whole: bool = False
) -> None:
    """Print a paragraph.

    Args:
        console: where.
        words: the text.
        style: of rich.
        indent: columns it is moved to the right.
        whole: for text with paths and commands: broken only where there is a width to keep.
            Without an indent it is one line, whatever a path holds.
    """
    text = Text(clean(words) if not whole or indent else line_of(words), style=style)
    if console.has_width or (console.wraps and not whole):
        show(console, _indented(text, indent) if indent else text)
    else:
        for line in text.split("\n", allow_blank=True):
            line.pad_left(indent)
            console.print(line, soft_wrap=True)


def show(console: Terminal, shape: RenderableType) -> None:
    """Print a table or another shape; where it is no terminal, without spaces at line ends."""
    if console.is_terminal:
        console.print(shape, overflow="fold")
        return
    with console.capture() as capture:
        console.print(shape, overflow="fold")
    lines = capture.get().splitlines()
    console.print(Text("\n".join(line.rstrip() for line in lines)), soft_wrap=True)


def prose(console: Terminal, words: str) -> None:
    """Print a docstring: paragraphs are filled, indented lines stay lines."""
    if not console.wraps:
        say(console, words)
        return
    for block in words.split("\n\n"):
        paragraph: list[str] = []
        for line in block.splitlines():
            indent = len(line) - len(line.lstrip())
            if not indent:
                paragraph.append(line)
                continue
            if paragraph:
                say(console, " ".join(paragraph))
                paragraph = []
            hanging = Table.grid()
            hanging.add_column(width=indent)
            hanging.add_column(overflow="fold")
            hanging.add_row("", Text(clean(line.strip())))
            show(console, hanging)
        if paragraph:
            say(console, " ".join(paragraph))
        console.print()


def _indented(shape: RenderableType, indent: int) -> RenderableType:
    return Padding(shape, (0, 0, 0, indent), expand=False)


def items(console: Terminal, texts: Iterable[str], style: str = "") -> None:
    """Print a list, each of its texts behind a dash."""
    for words in texts:
        if console.wraps:
            grid = Table.grid(padding=(0, 1))
            grid.add_column(width=3)
            grid.add_column(overflow="fold")
            grid.add_row("  -", Text(clean(words), style=style))
            show(console, grid)
        else:
            console.print(Text(f"  - {line_of(words)}", style=style), soft_wrap=True)


def title(console: Terminal, words: str) -> None:
    """Print a heading, one line."""
    say(console, line_of(words), "bold")


def facts(console: Terminal, pairs: Iterable[tuple[str, str]]) -> None:
    """Print names and what there is to say of each; empty ones are left out."""
    there = [(name, words) for name, words in pairs if words]
    if not there:
        return
    width = max(len(name) for name, _ in there)
    if not console.wraps:
        for name, words in there:
            console.print(Text(f"  {name:{width}}  {line_of(words)}"), soft_wrap=True)
        return
    grid = Table.grid(padding=(0, 2))
    grid.add_column(no_wrap=True, min_width=width)
    grid.add_column(overflow="fold")
    for name, words in there:
        grid.add_row(Text(name, style="cyan"), Text(clean(words)))
    show(console, _indented(grid, 2))


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    *,
    right: Sequence[int] = (),
    fixed: Sequence[int] = (),
) -> RenderableType:
    """A table without lines.

    Args:
        columns: headings.
        rows: a text for each column.
        right: columns set to the right.
        fixed: columns that are not broken into lines as long as the others can be.
    """
    grid = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="cyan")
    for k, name in enumerate(columns):
        justify: Any = "right" if k in right else "left"
        grid.add_column(name, justify=justify, no_wrap=k in fixed, overflow="fold")
    for row in rows:
        grid.add_row(*(Text(clean(c)) if isinstance(c, str) else c for c in row))
    return _indented(grid, 2)


def print_json(data: Any) -> None:
    """Print one JSON object to stdout: ASCII, numbers that are not finite as null."""
    try:
        stream = json_stream()
        stream.write(json.dumps(plain(data), indent=2, allow_nan=False) + "\n")
        stream.flush()
    except OSError as error:
        leave_stdout(error)


def plain(value: Any) -> Any:
    """Data as JSON has it: numpy's numbers and arrays, tuples and paths become plain."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, int) and value.bit_length() > LONGEST_INTEGER:
        return hex(value)
    if isinstance(value, (bool, int, float, str, type(None))):
        return value
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in value]
    return str(value)


def clean(words: str) -> str:
    """Text without control characters, which could move a terminal's cursor."""
    return "".join(c if c.isprintable() or c == "\n" else _escaped(c) for c in words)


def line_of(words: str) -> str:
    """The same in one line: what a file holds makes no line that looks like one of ours."""
    return clean(words.replace("\n", " "))


def _escaped(character: str) -> str:
    return " " if character in "\t\r" else character.encode("unicode_escape", "replace").decode()


def count(number: int, word: str, plural: str = "") -> str:
    """A number with its noun: "1 body", "3 bodies"."""
    noun = word if number == 1 else plural or f"{word}s"
    return f"{number:,} {noun}" if number else f"no {plural or word + 's'}"


def seconds(duration: float) -> str:
    """A duration for people."""
    if duration < 0.0995:
        return f"{1e3 * duration:.3g} ms"
    if duration < 120.0:
        return f"{duration:.3g} s"
    minutes, rest = divmod(round(duration), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def size(byte_count: int) -> str:
    """A size of a file for people."""
    for unit in ("bytes", "kB", "MB"):
        if byte_count < 1000:
            return f"{byte_count:.3g} {unit}" if unit != "bytes" else f"{byte_count} bytes"
        byte_count = byte_count / 1000  # type: ignore[assignment]
    return f"{byte_count:.3g} GB"
