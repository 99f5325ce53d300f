"""Check that src and plugins define no name, and use no words, that another one has replaced.

A name says what it holds in the words of the field: numerical analysis, multibody dynamics, files.
One that did not was replaced once; it does not come back.

    python tools/check_words.py [ROOT]

Prints one line a finding, as PATH:LINE: what; exits with 1 if there is any.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDERS = ("src", "plugins")
#: Name of a function, class or constant -> what replaced it.
NAMES = {
    "FAR": "a name that says of what, such as FARTHEST_MOTION",
    "ROUNDING": "a name that says of what, such as RATE_ROUNDING",
    "AGAIN": "a name that says of what, such as SECOND_RUN_FACTOR",
    "ASIDE": "OFFSET_ANGLE",
    "Pulling": "UnilateralMonitor",
    "Rest": "EquilibriumSolution",
    "SEEKING": "UNKNOWN_PASSES",
    "_EnoughError": "_StopComparisonError",
    "_again": "_rerun_with",
    "_is_large_tree": "a question that does not act",
    "_lost": "_divergence_note",
    "begin_other": "switch_integrator",
    "cannot_cross": "singular_failure_message",
    "choice": "select_method",
    "compiled_exactly": "compile_exact",
    "doubts": "accuracy_warnings",
    "find_together": "solve_coupled",
    "finer": "tightened",
    "go": "execute",
    "halved": "with_midpoints",
    "look": "update",
    "oddity": "unusual_value_note",
    "report_twins": "report_duplicates",
    "why_unmade": "rebuild_error",
}
#: Definitions of such names that are right -> why.
ALLOWED = {
    ("src/dap3d_core/interface/fields.py", "choice"): "the maker of fields of types",
    ("src/dap3d_core/cli/framework/command.py", "AGAIN"): "seconds between two signals",
    ("src/dap3d_core/registry/guard.py", "AGAIN"): "seconds between two signals",
}
#: Files of these names -> what they are called now.
FILES = {
    "added.py": "plugin_integrators.py",
    "closed_joints.py": "a part of classify.py",
    "elimination.py": "eliminate_unknowns.py",
    "tree_points.py": "compiled_batch.py",
}
#: Words of docstrings and messages -> what to write.
WORDS = {
    r"[Tt]he \w+ floor\b": "layer",
    r"What ends it has": "that an interrupted run attaches its result to the exception",
    r"be one across": "that a step is aimed across",
    r"[Tt]he same for arrays": "array version of, with the name",
    r"\bthereof\b": "of it",
    r"\bwhence\b": "from which",
}


def findings(root: Path) -> Iterator[str]:
    """Yield what is named as it should no longer be, in order of the paths."""
    for path in sorted(p for folder in FOLDERS for p in (root / folder).rglob("*.py")):
        name = path.relative_to(root).as_posix()
        text = path.read_text(encoding="utf-8")
        if path.name in FILES:
            yield f"{name}:1: the file is {FILES[path.name]}"
        for line, defined in definitions(ast.parse(text, filename=name)):
            if defined in NAMES and (name, defined) not in ALLOWED:
                yield f"{name}:{line}: {defined}: write {NAMES[defined]}"
        for line, content in enumerate(text.splitlines(), 1):
            for pattern, better in WORDS.items():
                if found := re.search(pattern, content):
                    yield f"{name}:{line}: {found[0]!r}: write {better}"


def definitions(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield (line, name) of functions and classes, and of constants of the module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.lineno, node.name
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        for name in (one for target in targets for one in ast.walk(target)):
            if isinstance(name, ast.Name):
                yield node.lineno, name.id


def main(arguments: list[str]) -> int:
    """Print the findings and return the exit status."""
    root = Path(arguments[0]) if arguments else Path(__file__).resolve().parent.parent
    found = list(findings(root))
    print("\n".join(found) if found else f"words: {len(NAMES)} names and their like are gone")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
