"""Pieces of Markdown."""

import inspect
from collections.abc import Iterable, Sequence
from typing import Any


def cell(text: str) -> str:
    """Text in a cell of a table: bars in it are no borders, lines are joined."""
    return " ".join(text.split()).replace("|", r"\|")


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table, its cells as Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(cell(text) for text in line)} |" for line in lines) + "\n"


def code(text: str) -> str:
    """A word as code; nothing for nothing."""
    return f"`{text}`" if text else ""


def fenced(text: str, language: str) -> str:
    """A block of code."""
    return f"```{language}\n{text.rstrip()}\n```\n"


def directive(name: str, argument: str, body: str = "") -> str:
    """A directive of Sphinx that reads its content as reStructuredText, such as autofunction."""
    lines = "\n".join(f"   {line}" if line else "" for line in body.splitlines())
    return f"```{{eval-rst}}\n.. {name}:: {argument}\n{lines}\n```\n"


def doc_of(thing: Any) -> str:
    """A docstring without its indentation. Its indented formulas are blocks of code here as well.

    Raises:
        LookupError: there is none.
    """
    text = inspect.getdoc(thing)
    if not text:
        raise LookupError(f"{thing!r} has no docstring")
    return text


def page(title: str, *parts: str) -> str:
    """A page: its title and its paragraphs."""
    return "\n".join([f"# {title}\n", *(f"{part.strip()}\n" for part in parts if part.strip())])


def toctree(*documents: str, hidden: bool = False) -> str:
    """The list of pages below this one."""
    options = ":hidden:\n" if hidden else ""
    return f"```{{toctree}}\n:maxdepth: 1\n{options}\n" + "\n".join(documents) + "\n```\n"
