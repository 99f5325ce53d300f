"""Modules that are written by dap3d itself: files of the cache folder, each under its digest."""

import importlib.util
import linecache
import os
import sys
import uuid
from pathlib import Path
from typing import Any

from dap3d_core.kernels.runtime.cache import cache_folder
from dap3d_core.kernels.runtime.sealed_files import sealed, sealed_content


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
    if kept(name) == text:
        return path
    try:
        path.parent.mkdir(exist_ok=True)
        aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        try:
            with aside.open("xb") as file:
                file.write(sealed(text.encode()))
            os.replace(aside, path)
        finally:
            aside.unlink(missing_ok=True)
    except OSError:
        return None
    return path


def kept(name: str) -> str | None:
    """The source of a module that an earlier process wrote; None where there is none."""
    folder = cache_folder()
    content = None if folder is None else sealed_content(place_of(folder, name))
    return None if content is None else content.decode()


def place_of(folder: Path, name: str) -> Path:
    """Where the module of a name stands in the cache folder."""
    return folder / name / f"{name.replace('-', '_')}.py"


def load(path: Path | None, name: str, text: str) -> dict[str, Any]:
    """The namespace of a module, made from its text; with a path other modules can import it.

    No bytecode is read or written beside it: that has no checksum.
    """
    if path is None:
        file = f"<{name}>"
        namespace = {"__name__": f"dap3d_{name.replace('-', '_')}"}
        linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
        exec(compile(text, file, "exec"), namespace)  # our own text, as importing would do
        return namespace
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    exec(compile(text, str(path), "exec"), vars(module))
    return vars(module)
