"""Consoles, and the forms that all output has: paragraphs, lists, tables, JSON.

Text is plain where it goes to a file or another program. Results are wrapped at 80 columns then;
messages keep their lines, for programs that look for places in them.
"""

import json
import math
import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from dap3d_core.cli.process import streams

#: Bits of an integer; Python refuses to write more than some 14000 of them in decimal digits.
LONGEST_INTEGER = 4096
#: What an item of a list begins with.
ITEM = "  - "


class Terminal(Console):
    """A console without markup, which falls silent when its reader is gone or its disk is full."""

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
        """Write nothing more; the command runs to its end."""
        self._leave(None)

    def _leave(self, error: OSError | None) -> None:
        self.quiet = True
        streams.leave_stderr() if self.stderr else streams.leave_stdout(error)

    @property
    def wraps(self) -> bool:
        """True if lines are wrapped: all but messages that do not go to a terminal."""
        return not self.stderr or self.has_width

    @property
    def has_width(self) -> bool:
        """True on a terminal, or if the environment gives a width."""
        return self.is_terminal or "COLUMNS" in os.environ

    def say(self, words: str, style: str = "", indent: int = 0, *, whole: bool = False) -> None:
        """Print a paragraph in a style of rich, indented by columns.

        ``whole`` is for text with paths and commands: it is broken only if the console has a width,
        and without an indent it is one line, whatever a path contains.
        """
        text = Text(clean(words) if not whole or indent else line_of(words), style=style)
        if self.has_width or (self.wraps and not whole):
            self.show(_indented(text, indent) if indent else text)
        else:
            for line in text.split("\n", allow_blank=True):
                line.pad_left(indent)
                self.print(line, soft_wrap=True)

    def show(self, shape: RenderableType) -> None:
        """Print a shape of rich, without spaces at line ends unless on a terminal."""
        if self.is_terminal:
            self.print(shape, overflow="fold")
            return
        with self.capture() as capture:
            self.print(shape, overflow="fold")
        lines = capture.get().splitlines()
        self.print(Text("\n".join(line.rstrip() for line in lines)), soft_wrap=True)

    def prose(self, words: str) -> None:
        """Print a docstring: paragraphs and items are filled, indented lines stay lines."""
        if not self.wraps:
            self.say(words)
            return
        for block in words.split("\n\n"):
            for lead, text in _pieces_of(block):
                if lead:
                    self._hang(lead, text)
                else:
                    self.say(text)
            self.print()

    def _hang(self, lead: str, words: str, style: str = "") -> None:
        """Print text with a hanging indent of the width of its lead."""
        grid = Table.grid()
        grid.add_column(width=len(lead))
        grid.add_column(overflow="fold")
        grid.add_row(lead, Text(clean(words), style=style))
        self.show(grid)

    def items(self, texts: Iterable[str], style: str = "") -> None:
        """Print a list, each text after a dash."""
        for words in texts:
            if self.wraps:
                self._hang(ITEM, words, style)
            else:
                self.print(Text(f"{ITEM}{line_of(words)}", style=style), soft_wrap=True)

    def title(self, words: str) -> None:
        """Print a heading, one line."""
        self.say(line_of(words), "bold")

    def section(self, heading: str, texts: Sequence[str], style: str = "") -> None:
        """Print a heading and a list; nothing if the list is empty."""
        if texts:
            self.title(heading)
            self.items(texts, style)

    def facts(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Print names with their descriptions; empty ones are left out."""
        rows = [(name, words) for name, words in pairs if words]
        width = max((len(name) for name, _ in rows), default=0)
        if not self.wraps:
            for name, words in rows:
                self.print(Text(f"  {name:{width}}  {line_of(words)}"), soft_wrap=True)
        elif rows:
            grid = Table.grid(padding=(0, 2))
            grid.add_column(no_wrap=True, min_width=width)
            grid.add_column(overflow="fold")
            for name, words in rows:
                grid.add_row(Text(name, style="cyan"), Text(clean(words)))
            self.show(_indented(grid, 2))

    def table(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[str | Text]],
        *,
        right: Sequence[int] = (),
        fixed: Sequence[int] = (),
    ) -> None:
        """Print a table without lines.

        Columns ``right`` are aligned to the right; columns ``fixed`` are broken into lines only if
        no other column can be. Columns without a word, beside which others would be broken, are
        left out. Where words or numbers would be broken all the same, each row is a list of facts.
        """
        rows = list(rows)
        kept = [k for k, name in enumerate(columns) if name or any(row[k] for row in rows)]
        grid = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="cyan")
        for k in kept:
            justify: Any = "right" if k in right else "left"
            whole = k in fixed or k in right or not any(" " in str(row[k]) for row in rows)
            grid.add_column(columns[k], justify=justify, no_wrap=whole, overflow="fold")
        for row in rows:
            cells = (row[k] for k in kept)
            grid.add_row(*(Text(clean(c)) if isinstance(c, str) else c for c in cells))
        if self.measure(grid).minimum + 2 <= self.width:
            self.show(_indented(grid, 2))
            return
        for number, row in enumerate(rows):
            if number:
                self.print()
            self.facts((columns[k], str(row[k])) for k in kept)


def _without_colors() -> bool | None:
    """True after ``--no-color``; None leaves it to the environment (NO_COLOR)."""
    ctx = click.get_current_context(silent=True)
    return True if ctx is not None and ctx.color is False else None


def _pieces_of(block: str) -> list[tuple[str, str]]:
    """A paragraph's leads and texts: "" of what is filled, of an indented line its indent, or ITEM.

    Items begin with "* "; lines behind one that are indented belong to it.
    """
    found: list[tuple[str, str]] = []
    for line in block.splitlines():
        words, lead = line.strip(), line[: len(line) - len(line.lstrip())]
        before = found[-1][0] if found else None
        if line.startswith("* "):
            found.append((ITEM, words.removeprefix("* ")))
        elif before == (ITEM if lead else ""):
            found[-1] = (before, f"{found[-1][1]} {words}")
        else:
            found.append((lead, words))
    return found


def _indented(shape: RenderableType, indent: int) -> RenderableType:
    return Padding(shape, (0, 0, 0, indent), expand=False)


def stdout() -> Terminal:
    """The console of results: stdout."""
    return Terminal()


def stderr() -> Terminal:
    """The console of everything else, such as errors and progress: stderr."""
    return Terminal(stderr=True)


def show_written(
    target: Path, contents: str, data: Mapping[str, Any], notes: Sequence[str] = ()
) -> None:
    """Report a file that was written: its contents in words, or the same as JSON data."""
    byte_count = target.stat().st_size
    if streams.prints_json():
        about = {"file": str(target), "size_bytes": byte_count}
        print_json({**about, **data, "notes": list(notes)})
    elif not streams.is_quiet():
        stderr().items(notes)
        stdout().say(f"{target} written ({size(byte_count)}): {contents}", whole=True)


def show_data(data: Any, show: Callable[[Terminal], None], *written: str | Path | None) -> None:
    """Print data as JSON, or what ``show`` prints of it and the files that were written."""
    if streams.prints_json():
        print_json(data)
    elif not streams.is_quiet():
        console = stdout()
        show(console)
        for target in filter(None, written):
            console.say(f"{target} written", whole=True)


def print_json(data: Any) -> None:
    """Print one JSON object to stdout: ASCII, numbers that are not finite as null."""
    try:
        stream = streams.json_stream()
        stream.write(json.dumps(json_value(data), indent=2, allow_nan=False) + "\n")
        stream.flush()
    except OSError as error:
        streams.leave_stdout(error)


def json_value(value: Any) -> Any:
    """Data as JSON holds it; numpy's numbers and arrays, tuples and paths are converted."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, int) and value.bit_length() > LONGEST_INTEGER:
        return hex(value)
    if isinstance(value, (bool, int, float, str, type(None))):
        return value
    if isinstance(value, Mapping):
        return {str(k): json_value(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [json_value(v) for v in value]
    return str(value)


def shell_word(path: str | Path) -> str:
    """A path as a word of a shell, which no command takes for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def clean(words: str) -> str:
    """Text without control characters, which could move a terminal's cursor."""
    return "".join(c if c.isprintable() or c == "\n" else _escaped(c) for c in words)


def line_of(words: str) -> str:
    """The same in one line: the contents of a file cannot imitate a line of the program."""
    return clean(words.replace("\n", " "))


def _escaped(character: str) -> str:
    return " " if character in "\t\r" else character.encode("unicode_escape", "replace").decode()


def scene_name(name: str) -> str:
    """The name of a scene in a heading."""
    return name or "scene without a name"


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


def size(byte_count: float) -> str:
    """The size of a file for people."""
    if byte_count < 1000:
        return f"{byte_count} bytes"
    for unit in ("kB", "MB"):
        byte_count /= 1000
        if byte_count < 1000:
            return f"{byte_count:.3g} {unit}"
    return f"{byte_count / 1000:.3g} GB"
