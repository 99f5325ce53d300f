"""Check the sizes of folders, files and functions in src and plugins.

A folder of the core holds at most 12 files (without ``__init__.py``), a file is under 500 lines,
a function under 60. A file has one subject; what grows past the limit usually has two. Where more
is right, it is listed in EXEMPT with the reason. An exemption that is no longer needed is a finding
as well.

    python tools/check_sizes.py [ROOT]

Prints one line a finding, as PATH:LINE: what; exits with 1 if there is any.
"""

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

FOLDER_LIMIT = 12
FILE_LIMIT = 500
FUNCTION_LIMIT = 60
FOLDERS = ("src", "plugins")

#: "path" or "path:Class.function" -> why it may be larger. Tables of numbers are the usual reason.
EXEMPT: dict[str, str] = {
    "src/dap3d_core/cli/commands": "one file a command",
}


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
    """Yield what is over its limit, exempt or not, in order of the paths."""
    paths = sorted(p for folder in FOLDERS for p in (root / folder).rglob("*.py"))
    core = (p for p in paths if "dap3d_core" in p.parts and p.stem != "__init__")
    for folder, count in Counter(p.parent for p in core).items():
        if count > FOLDER_LIMIT:
            name = folder.relative_to(root).as_posix()
            yield Finding(name, 1, f"folder of {count} files, must be at most {FOLDER_LIMIT}")
    for path in paths:
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
        else f"sizes: folders of at most {FOLDER_LIMIT} files, files under {FILE_LIMIT} lines, "
        f"functions under {FUNCTION_LIMIT}"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
