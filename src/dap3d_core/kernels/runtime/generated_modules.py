"""Python modules written by dap3d: files of the cache folder, each named by a digest."""

import importlib.util
import linecache
import sys
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from types import CodeType
from typing import Any

from dap3d_core.kernels.runtime.cache import cache_folder
from dap3d_core.kernels.runtime.sealed_files import sealed, sealed_content, write_file


def write(name: str, text: str) -> Path | None:
    """Write a module for all processes; None where nothing can be written.

    Args:
        name: of its folder; contains a digest of all that decides the text.
        text: its source.
    """
    path = _path_of(name)
    if path is None or kept(name) == text:
        return path
    with suppress(OSError):
        path.parent.mkdir(exist_ok=True)
    return path if write_file(path, sealed(text.encode())) else None


def kept(name: str) -> str | None:
    """The source of a module that an earlier process wrote; None where there is none."""
    path = _path_of(name)
    content = None if path is None else sealed_content(path)
    return None if content is None else content.decode()


def _path_of(name: str) -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / name / f"{name.replace('-', '_')}.py"


def load(path: Path | None, name: str, text: str) -> dict[str, Any]:
    """The namespace of a module, made from its text; with a path other modules can import it.

    No bytecode is read or written: it has no checksum.
    """
    if path is None:
        file = f"<{name}>"
        namespace = {"__name__": f"dap3d_{name.replace('-', '_')}"}
        linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    else:
        file = str(path)
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
        namespace = vars(module)
    exec(_code(text, file), namespace)  # our own text, as an import would do
    return namespace


@lru_cache(maxsize=256)
def _code(text: str, file: str) -> CodeType:
    """Bytecode of a text: derivatives run the same loops again and again."""
    return compile(text, file, "exec")
