"""Pages whose every example is run, in the order in which a reader would.
A block whose first line is ``# NAME`` or ``<!-- NAME -->``, with a suffix, is a file of that name;
other blocks of Python are one script, each going on where the last one ended; indented lines that
begin with ``dap3d`` are commands."""

import os
import re
import shlex
import sys
from pathlib import Path
from typing import NamedTuple

from dap3d_core.cli import main

FILE = re.compile(r"(?:# |<!-- )(?P<name>\S+\.\w+)(?: -->)?\n")


class Step(NamedTuple):
    """Something that a page has its reader do, and the line where it stands."""

    kind: str
    text: str
    line: int


def steps(text, programs=("dap3d",)):
    """The steps of a page, in order: files to write, Python to run, commands of these programs."""
    names = "|".join(programs)
    step = re.compile(rf"^```[a-z]+\n.*?^```|^    (?:{names}) [^\n]*", re.MULTILINE | re.DOTALL)
    for match in step.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        fence, _, block = match[0].partition("\n")
        if not fence.startswith("```"):
            yield Step("command", match[0].strip(), line)
            continue
        block = block.removesuffix("```")
        if FILE.match(block):
            yield Step("file", block, line)
        elif fence == "```python":
            yield Step("python", block, line)


def follow(page: Path, folder: Path, changes=()):
    """Do what a page says, in a folder; returns the steps that were done.

    Args:
        changes: pairs of words of the page and what is taken for them.

    Raises:
        AssertionError: a command fails; says which, on which line.
    """
    text = page.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    names = {"__name__": "__main__"}
    done = list(steps(text))
    before = Path.cwd()
    os.chdir(folder)
    try:
        for step in done:
            if step.kind == "file":
                write(step.text, folder)
            elif step.kind == "python":
                lines = "\n" * step.line + step.text  # so that a failure names the page's line
                exec(compile(lines, str(page), "exec"), names)
            else:
                command(step, page)
    finally:
        os.chdir(before)
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
    return done


def write(block, folder):
    """Write a block to the file that its first line names."""
    target = folder / FILE.match(block)["name"]
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(block, encoding="utf-8")


def command(step, page):
    """Run a command, here: a process for each would take most of its time to begin."""
    code = main(shlex.split(step.text, comments=True)[1:])
    assert code == 0, f"{page}:{step.line}: {step.text}: exit code {code}"
