"""Modules that are written by dap3d itself: files of the cache folder, each under its digest."""

import importlib.util
import linecache
import os
import sys
import uuid
from pathlib import Path
from typing import Any

from dap3d_core.kernels.cache import cache_folder


def write(name: str, text: str) -> Path | None:
    """Put a module where every process finds it; None where nothing can be written.

    Args:
        name: of its folder; a digest of all that decides the text is part of it.
        text: its source.

    It is written aside and renamed, for two processes may race.
    """
    folder = cache_folder()
    if folder is None:
        return None
    path = place_of(folder, name)
    if path.exists():
        return path
    try:
        path.parent.mkdir(exist_ok=True)
        aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        with aside.open("x", encoding="utf-8") as file:
            file.write(text)
        os.replace(aside, path)
    except OSError:
        return None
    return path


def place_of(folder: Path, name: str) -> Path:
    """Where the module of a name stands in the cache folder."""
    return folder / name / f"{name.replace('-', '_')}.py"


def load(path: Path | None, name: str, text: str) -> dict[str, Any]:
    """The namespace of a written module; without a path it is made from the text."""
    if path is None:
        file = f"<{name}>"
        namespace = {"__name__": f"dap3d_{name.replace('-', '_')}"}
        linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
        exec(compile(text, file, "exec"), namespace)  # our own text, as importing would do
        return namespace
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return vars(module)
