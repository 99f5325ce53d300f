"""Docstrings and signatures as Sphinx is given them by autodoc.

Names that share a line, ``rtol, atol: tolerances``, are one entry of a list here; the usual reading
of such a docstring takes the first one for the type of the second.
"""

import re
from collections.abc import Iterator
from typing import Any

#: Sections that become lists, and what stands above them.
LISTS = {"Args:": "**Parameters**", "Attributes:": "**Attributes**"}
ENTRY = re.compile(r"    (?P<names>[\w*]+(?:, [\w*]+)*): (?P<text>.*)")


def lists(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Turn sections of names into lists, in place; before napoleon reads the others."""
    lines[:] = _with_lists(lines)


def _with_lists(lines: list[str]) -> Iterator[str]:
    inside = False
    for line in lines:
        if line in LISTS:
            inside = True
            yield from (LISTS[line], "")
        elif inside and (entry := ENTRY.fullmatch(line)):
            names = entry["names"].replace("*", r"\*")
            yield f"* **{names}**: {entry['text']}"
        elif inside and line.startswith("     "):
            yield f"  {line.strip()}"
        else:
            inside = inside and not line
            yield line


def signature(
    app: Any, what: str, name: str, thing: Any, options: Any, written: str | None, returns: str
) -> tuple[str, str] | None:
    """Say what stands where there is no default: REQUIRED of a field, a new value of a class."""
    if written is None:
        return None
    return written.replace("NOTHING", "..." if what == "class" else "REQUIRED"), returns
