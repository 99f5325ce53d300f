"""Sources of the types of a scene: results and checkpoints record them, and compare them later."""

import ast
import hashlib
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from dap3d_core.kernels.syntax import parse

if TYPE_CHECKING:
    from dap3d_core.scene import ValidatedScene

#: Its sources are known by the version of dap3d.
CORE = "dap3d_core"
#: Fields of statements that hold others.
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


def digests_of(checked: "ValidatedScene") -> dict[str, str]:
    """For each type of a scene, such as "joint rev", a digest of its sources; "" where unknown.

    A type that the scene names with its package is "joint dap3d-other:rev" here as well.
    """
    types: dict[tuple[str, str], Any] = {}
    for table in ("joints", "forces", "functions"):
        given = getattr(checked.scene, table)
        for one in getattr(checked, table):
            type_ = one.type_info.type
            word = str(given[one.name].type) if one.name in given else type_.keyword
            types[type_.kind, word] = type_
    return {f"{kind} {word}": digest_of(type_) for (kind, word), type_ in sorted(types.items())}


def types_of(checked: "ValidatedScene") -> dict[str, dict[str, str]]:
    """For each type of a scene its ``digest``, and the ``distribution`` and ``version`` it is from.

    The latter two are "" for a type of a model's own file.
    """
    found = {}
    for name, digest in digests_of(checked).items():
        kind, word = name.split(" ", 1)
        sources = checked.registry.sources_of(kind, word)
        distribution, version = (
            (sources[0].distribution, sources[0].version) if sources else ("", "")
        )
        found[name] = {"digest": digest, "distribution": distribution, "version": version}
    return found


def changed_types(
    known: Mapping[str, Mapping[str, str]], here: Mapping[str, Mapping[str, str]]
) -> list[str]:
    """The types whose sources are not those that are known, each with what brings it, in words."""
    found = []
    for name, before in known.items():
        now = here.get(name, {})
        if before.get("digest") != now.get("digest"):
            old, new = _package(before), _package(now)
            origin = old if old == new else f"{old}, here {new}"
            found.append(f"{name} ({origin})")
    return found


def _package(of: Mapping[str, str]) -> str:
    if not of:
        return "none"
    return (
        f"{of.get('distribution')} {of.get('version')}" if of.get("distribution") else "plugin.py"
    )


@lru_cache(maxsize=1000)
def digest_of(type_: Any) -> str:
    """A digest of the code of a type: of its own file, and of those of its package that it uses.

    Comments, docstrings and symbols of pictures are left out. "" where there is no file, such as
    of a type that was typed at a prompt.
    """
    waiting = [sys.modules.get(base.__module__) for base in type_.__mro__]
    root = type_.__module__.partition(".")[0]
    modules: dict[str, bytes] = {}
    while waiting:
        module = waiting.pop()
        if module is None or module.__name__ in modules:
            continue
        if module.__name__.partition(".")[0] != root or root == CORE:
            continue
        try:
            modules[module.__name__] = _code_of(Path(module.__file__ or "").read_bytes())
        except OSError:
            return ""
        for value in list(vars(module).values()):
            name = getattr(value, "__module__", None)
            is_module = isinstance(value, ModuleType)
            waiting.append(value if is_module else sys.modules.get(name or ""))
    if not modules:
        return ""
    together = hashlib.sha256()
    for name in sorted(modules):
        together.update(hashlib.sha256(modules[name]).digest())
    return together.hexdigest()[:20]


@lru_cache(maxsize=1000)  # types of a package share files
def _code_of(content: bytes) -> bytes:
    """The content of a source file without what changes no formula; of another file, all of it."""
    try:
        tree = parse(content)
    except (SyntaxError, ValueError):
        return content
    _keep_formulas(tree)
    return ast.unparse(tree).encode()


def _keep_formulas(node: ast.AST) -> None:
    """Remove statements that are a text alone, and what a class says of its picture."""
    for field in BLOCKS:
        inner = getattr(node, field, None)
        if isinstance(inner, list):  # of a lambda or a conditional expression it is none
            inner[:] = [one for one in inner if not _is_text(one, isinstance(node, ast.ClassDef))]
            for one in inner:
                _keep_formulas(one)


def _is_text(node: ast.AST, in_class: bool) -> bool:
    """True of a text alone, and of the ``symbol`` of a class, from which nothing is computed."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)
    return in_class and isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "symbol"
