"""Where compiled code is kept, and under which digest.

numba's own cache looks at one source file only: a function that calls a helper of another file
would go on giving the old number after the helper changed. So compiled code lives in folders named
by a digest of *all* the sources that went into it; a change anywhere leads to another folder
(docs/decisions/0001).
"""

import hashlib
import os
import sys
import tempfile
import threading
import types
from contextlib import suppress
from functools import cache
from pathlib import Path

import numba
from numba import config, njit

from dap3d_core.kernels.sealed_files import SealedCache
from dap3d_core.kernels.trusted import distrust

#: How the core and the group loops are compiled: no bounds checks, IEEE division, nothing
#: reassociated.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True}

#: Floors of the core that hold compiled code, low to high: a function depends on its own floor and
#: those below.
COMPILED_FLOORS = ("kernels", "assembly", "linear", "formulations", "integrators", "study")

#: numba takes the folder of its cache from one setting of the process. Nothing is imported while
#: this is held.
_folder_of_numba = threading.Lock()


def jit_is_on() -> bool:
    """Whether kernels are compiled; ``NUMBA_DISABLE_JIT=1`` runs them as plain Python."""
    return not config.DISABLE_JIT


def cache_folder() -> Path | None:
    """The folder that keeps compiled code between processes, or None where there can be none.

    The first of these that can be written, and by this user alone: ``$DAP3D_CACHE_DIR``, the user's
    cache folder, a private folder beside the temporary files.
    """
    return _chosen()[0]


def cache_notes() -> tuple[str, ...]:
    """Folders that were passed over because others may write to them, and what to do."""
    return _chosen()[1]


@cache
def _chosen() -> tuple[Path | None, tuple[str, ...]]:
    notes = []
    for folder in _candidates():
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if why := distrust(folder):
                words = f"compiled code is not kept in {folder}, for what is there is run: {why}"
                notes.append(f"{words}; DAP3D_CACHE_DIR names another folder")
                continue
            with tempfile.TemporaryFile(dir=folder):
                return folder, tuple(notes)
        except OSError:
            continue
    return None, tuple(notes)


def _candidates():
    if chosen := os.environ.get("DAP3D_CACHE_DIR"):
        yield Path(chosen)
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME")
    with suppress(RuntimeError):  # no home folder
        yield (Path(home) if home else Path.home() / ".cache") / "dap3d"
    user = os.getuid() if hasattr(os, "getuid") else "user"
    yield Path(tempfile.gettempdir()) / f"dap3d-{user}"


def digest(*parts: str | bytes) -> str:
    """Digest of sources and of what else decides the code made from them (Python, numba)."""
    seal = hashlib.sha256()
    for part in (*parts, numba.__version__, f"{sys.version_info[:2]}", "sealed files"):
        seal.update(part.encode() if isinstance(part, str) else part)
        seal.update(b"\0")
    return seal.hexdigest()[:20]


@cache
def driver_digest(floor: str) -> str:
    """Digest of all sources that decide what the compiled code of a floor of the core computes."""
    root = Path(__file__).parents[1]
    below = COMPILED_FLOORS[: COMPILED_FLOORS.index(floor) + 1]
    files = sorted(f for name in below for f in (root / name).glob("*.py"))
    return digest(*(part for f in files for part in (f.name, f.read_bytes())))


def compiled(function):
    """Compile a function of the core at its first call, and keep the code for the next process."""
    return compiled_in(cache_folder(), _driver_folder(function), function)


def compiled_inside(function):
    """The same for a function that compiled code alone calls.

    It compiles faster, for it has no door to Python; called from there it would crash the process.
    """
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return compiled_in(cache_folder(), _driver_folder(function), function, **options)


def compiled_into(function):
    """The same for a function that is put into its callers before they are compiled.

    For parts of a right-hand side that hand on a tuple of many arrays: as calls, four of them cost
    as much as the physics of one body.
    """
    return compiled_in(cache_folder(), _driver_folder(function), function, inline="always")


def driver_is_cached(floor: str) -> bool:
    """Whether compiled code of a floor of the core is there from an earlier process."""
    folder = cache_folder()
    return folder is not None and any((folder / f"{floor}-{driver_digest(floor)}").glob("*/*.nbc"))


def _driver_folder(function) -> str:
    floor = function.__module__.split(".")[1]
    return f"{floor}-{driver_digest(floor)}"


def compiled_in(folder: Path | None, name: str, function, **options):
    """Compile with the cache in ``folder/name``; without a folder for this process alone."""
    if not jit_is_on():
        return function
    compiled_function = njit(**OPTIONS, **options)(function)
    if folder is None:
        return compiled_function
    with _folder_of_numba:
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder / name)
        try:
            kept = SealedCache(function)
        except RuntimeError:  # numba found no folder that can be written
            return compiled_function
        finally:
            config.CACHE_DIR = before
    if Path(kept.cache_path).is_relative_to(folder / name):  # not another folder of numba's choice
        compiled_function._cache = kept
    return compiled_function


def reached(*functions) -> tuple[list, list[str]]:
    """The functions that these call, themselves included, and values of the constants they read.

    Follows names from function to function through their modules' globals; numpy, numba and the
    standard library are left out.
    """
    found: dict[object, None] = {}
    constants: list[str] = []
    todo = list(functions)
    while todo:
        function = todo.pop()
        function = getattr(function, "py_func", function)
        if function in found:
            continue
        found[function] = None
        for name, value in _named_values(function):
            if isinstance(value, types.FunctionType) or hasattr(value, "py_func"):
                if _is_ours(getattr(value, "py_func", value).__code__.co_filename):
                    todo.append(value)
            elif isinstance(value, (bool, int, float, complex, str, tuple)):
                constants.append(f"{function.__qualname__}.{name}={value!r}")
    return list(found), constants


def sources(*functions) -> list[str | bytes]:
    """What decides what these functions compute: source files, constants, and names of modules.

    The names, because cached code imports its modules by name: a model's own file has another one
    in each folder.
    """
    found, constants = reached(*functions)
    files: dict[str, bytes] = {}
    for function in found:
        _add_file(files, function.__code__.co_filename)
    modules = sorted({function.__module__ for function in found})
    contents = (part for path in sorted(files) for part in (Path(path).name, files[path]))
    return [*constants, *modules, *contents]


def identities(*functions) -> list[str | bytes]:
    """Which functions of their files these are: variants of a type stand in one file."""
    codes = [function.__code__ for function in functions]
    return [*(f"{c.co_qualname} {c.co_firstlineno}" for c in codes), *(c.co_code for c in codes)]


def _named_values(function):
    """Names that a function reads from outside itself, with values; one step through modules."""
    code_objects = [function.__code__]
    for code in code_objects:
        code_objects += [c for c in code.co_consts if isinstance(c, types.CodeType)]
    names = {name for code in code_objects for name in code.co_names}
    cells = (cell.cell_contents for cell in function.__closure__ or ())
    outside = dict(zip(function.__code__.co_freevars, cells, strict=True))
    for name in sorted(names):
        if name in function.__globals__:
            outside[name] = function.__globals__[name]
    for name, value in list(outside.items()):
        if isinstance(value, types.ModuleType) and _is_ours(getattr(value, "__file__", None) or ""):
            outside |= {f"{name}.{n}": getattr(value, n) for n in names if hasattr(value, n)}
    return sorted(outside.items())


@cache
def _is_ours(filename: str) -> bool:
    standard = Path(os.__file__).parent
    path = Path(filename)
    if not filename.endswith(".py"):
        return False
    if path.is_relative_to(Path(numba.__file__).parent) or "numpy" in path.parts:
        return False
    return not (path.is_relative_to(standard) and "site-packages" not in path.parts)


def _add_file(files, filename):
    if filename not in files:
        try:
            files[filename] = Path(filename).read_bytes()
        except OSError:  # typed at a prompt: no file, so nothing of it is kept between processes
            files[filename] = os.urandom(16)
