"""Types that files declare, read as text: nothing of it is executed."""

import ast
import json
import os
import shlex
import tomllib
import warnings
from importlib.metadata import Distribution, distributions
from pathlib import Path
from urllib.parse import unquote

from dap3d_core.interface.hooks import GROUPS, KINDS
from dap3d_core.registry.regular_files import read_regular

#: Maximal size of a file, bytes.
LONGEST = 10**6
_BASES = {class_.__name__: kind for kind, class_ in KINDS.items()}


def declares(path: Path, kind: str, keyword: str) -> bool:
    """True if a Python file has a class of this kind with this keyword, as far as its text shows.

    A class with bases from another file may be of any kind.
    """
    try:
        text = read_regular(path) if path.stat().st_size <= LONGEST else b""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # repeated where the file is run
            tree = ast.parse(text)
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return False  # reported where the file is run
    kinds = dict(_BASES)
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            of_bases = [kinds.get(b.id, "") for b in node.bases if isinstance(b, ast.Name)]
            kinds[node.name] = next(filter(None, of_bases), "")
            if keyword in _keywords(node) and kinds[node.name] in (kind, ""):
                return True
    return False


def _keywords(node: ast.ClassDef) -> list[str]:
    """Values that a class assigns to ``keyword``, alone or as one of several names."""
    keywords = []
    for line in node.body:
        if isinstance(line, ast.Assign) and len(line.targets) == 1:
            target = line.targets[0]
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            values = line.value.elts if isinstance(line.value, ast.Tuple) else [line.value]
            for name, value in zip(names, values, strict=False):
                is_keyword = isinstance(name, ast.Name) and name.id == "keyword"
                if is_keyword and isinstance(value, ast.Constant):
                    keywords.append(str(value.value))
    return keywords


def not_yet_installed(keyword: str) -> str:
    """The remedy for a type that the source of an editable package declares since; "" for none.

    The entry points of an editable install are those of the day it was made.
    """
    for distribution in distributions():
        try:
            folder = editable_folder(distribution)
            if folder is None:
                continue
            file = folder / "pyproject.toml"
            entry_points = tomllib.loads(file.read_text("utf-8"))["project"]["entry-points"]
            groups = [entry_points.get(group, {}) for group, _ in GROUPS.values()]
        except Exception:  # the files are missing or damaged
            continue
        if any(keyword in group for group in groups):
            return (
                f"{file} declares {keyword!r} since it was installed: "
                f"run pip install -e {shlex.quote(str(folder))} again"
            )
    return ""


def editable_folder(distribution: Distribution) -> Path | None:
    """The folder of the sources of an editable install; None for any other install.

    Raises:
        Exception: what the install says of its origin is damaged.
    """
    origin = json.loads(distribution.read_text("direct_url.json") or "{}")
    is_editable = origin.get("dir_info", {}).get("editable")
    return _folder(origin["url"]) if is_editable else None


def _folder(url: str) -> Path:
    """The folder of a file URL."""
    path = unquote(url.removeprefix("file://"))
    return Path(path.lstrip("/") if os.name == "nt" else path)
