"""Check that files stay under 400 lines and functions under 60, in src and plugins.

A file has one subject; what grows past the limit usually has two. Where a longer one is right, it
is listed in EXEMPT with the reason. An exemption that is no longer needed is a finding as well.

    python tools/check_sizes.py [ROOT]

Prints one line a finding, as PATH:LINE: what; exits with 1 if there is any.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

FILE_LIMIT = 400
FUNCTION_LIMIT = 60
FOLDERS = ("src", "plugins")

#: "path" or "path:Class.function" -> why it may be longer. Tables of numbers are the usual reason.
EXEMPT: dict[str, str] = {}


class Finding(NamedTuple):
    """One thing that is longer than its limit."""

    key: str
    line: int
    text: str


def functions(tree: ast.AST, prefix: str = "") -> Iterator[tuple[str, int, int]]:
    """Yield (qualified name, first line, number of lines) of every function under a node.

    Decorators do not count; the docstring does.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            name = prefix + node.name
            yield name, node.lineno, (node.end_lineno or node.lineno) - node.lineno + 1
            yield from functions(node, f"{name}.")
        elif isinstance(node, ast.ClassDef):
            yield from functions(node, f"{prefix}{node.name}.")
        else:
            yield from functions(node, prefix)


def findings(root: Path) -> Iterator[Finding]:
    """Yield what is at or over its limit, exempt or not, in order of the paths."""
    for path in sorted(p for folder in FOLDERS for p in (root / folder).rglob("*.py")):
        name = path.relative_to(root).as_posix()
        text = path.read_text(encoding="utf-8")
        length = len(text.splitlines())
        if length >= FILE_LIMIT:
            yield Finding(name, 1, f"file of {length} lines, must be under {FILE_LIMIT}")
        for function, line, size in functions(ast.parse(text, filename=str(path))):
            if size >= FUNCTION_LIMIT:
                what = f"{function} has {size} lines, must be under {FUNCTION_LIMIT}"
                yield Finding(f"{name}:{function}", line, what)


def main(arguments: list[str]) -> int:
    """Print the findings and return the exit status."""
    root = Path(arguments[0]) if arguments else Path(__file__).resolve().parent.parent
    found = list(findings(root))
    bad = [f"{f.key.split(':')[0]}:{f.line}: {f.text}" for f in found if f.key not in EXEMPT]
    idle = EXEMPT.keys() - {f.key for f in found}
    bad += [f"tools/check_sizes.py:1: {key} is exempt and need not be" for key in sorted(idle)]
    print(
        "\n".join(bad)
        if bad
        else f"sizes: all files under {FILE_LIMIT} lines, functions under {FUNCTION_LIMIT}"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
