"""The compiled functions of the core; where compiled code is kept, and under which digest.

Object files are named by a digest of *all* the sources that went into them: a change anywhere makes
another file (docs/decisions/0001, 0026).
"""

import functools
import hashlib
import inspect
import os
import sys
import tempfile
import threading
import types
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.types import BOOL, FLOAT, INT, NOTHING, Scalar, Signature
from dap3d_core.kernels.compiler.units import (
    Entry,
    Functions,
    Unit,
    kind_of,
    type_of,
)
from dap3d_core.kernels.runtime.folder_security import distrust

#: Floors of the core that hold compiled code, low to high: a function depends on its own floor and
#: those below.
COMPILED_FLOORS = ("kernels", "model", "assembly", "linear", "formulations", "integrators", "study")

_RESULTS = {type_.name: type_ for type_ in (NOTHING, BOOL, INT, FLOAT)}
_units: dict[str, Unit] = {}
#: Held while a unit is made, which several threads may ask for at once.
_making = threading.RLock()


def jit_is_on() -> bool:
    """Whether kernels are compiled; ``DAP3D_PLAIN=1`` runs them as plain Python."""
    return os.environ.get("DAP3D_PLAIN", "0") in ("", "0")


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
    """Digest of sources and of the Python that reads them."""
    return source_digest(*parts, f"{sys.version_info[:2]}")


def source_digest(*parts: str | bytes) -> str:
    """Digest of sources alone."""
    seal = hashlib.sha256()
    for part in parts:
        seal.update(part.encode() if isinstance(part, str) else part)
        seal.update(b"\0")
    return seal.hexdigest()[:20]


@cache
def driver_digest(floor: str) -> str:
    """Digest of all sources that decide what the compiled code of a floor of the core computes."""
    root = Path(__file__).parents[2]
    below = COMPILED_FLOORS[: COMPILED_FLOORS.index(floor) + 1]
    files = sorted(f for name in below for f in (root / name).rglob("*.py"))
    parts = ((f.relative_to(root).as_posix(), f.read_bytes()) for f in files)
    return source_digest(*(part for both in parts for part in both))


def names_of(label: str, functions: Sequence[Any], *parts: str | bytes) -> tuple[str, str]:
    """Name of a unit among ready-made objects, and in the cache folder.

    Ready-made objects hold for any Python, LLVM and processor: their digest is of sources and of
    this compiler. What is in the cache was made by these, maybe of a function whose file has
    changed since it was loaded: that digest has the function's bytecode as well.

    Args:
        label: how both begin.
        functions: what the unit is made of.
        parts: digests, sources and words that decide the code.
    """
    ready = source_digest(*parts, objects.compiler())
    codes = [function.__code__.co_code for function in functions]
    return f"{label}-{ready}", f"{label}-{digest(ready, *codes, objects.identity())}"


class Compiled:
    """A function of the core, compiled for the types that it is called with.

    Attributes:
        is_inlined: whether it is put into its callers, once more for each constant that they give.
    """

    def __init__(self, function: Callable[..., Any], is_inlined: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.is_inlined = is_inlined
        self._parameters = list(inspect.signature(function).parameters.values())
        self._entries: dict[Any, Entry] = {}
        self._quick: dict[Any, Entry] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Call the code for the types of these arguments."""
        for parameter in self._parameters[len(arguments) :]:
            arguments += (parameter.default,)
        key = tuple([kind_of(a) for a in arguments])
        entry = self._quick.get(key)
        if entry is None:
            entry = self._quick[key] = self.compile([type_of(a) for a in arguments])
        return entry(*arguments)

    def compile(self, given: Sequence[Any]) -> Entry:
        """The function for types of its arguments, from the cache or compiled now."""
        key = tuple(given)
        if key not in self._entries:
            pairs = zip(key, self._parameters, strict=True)
            exact = tuple(FLOAT if t == INT and p.annotation is float else t for t, p in pairs)
            [self._entries[key]] = entries_of([self], exact)
        return self._entries[key]


def entries_of(functions: Sequence[Any], arguments: tuple[Any, ...]) -> list[Entry]:
    """Functions for types of their arguments, as one unit of compiled code."""
    plain = [inspect.unwrap(f) for f in functions]
    parts = [f"{f.__module__}.{f.__qualname__}" for f in plain]
    label = f"{plain[0].__module__.split('.')[-1]}.{plain[0].__name__}"
    ready_name, name = names_of(label, plain, repr(arguments), *parts, *_origin(plain))

    def write(symbols: list[str]) -> tuple[str, list[str]]:
        program = Program()
        pairs = zip(functions, symbols, strict=True)
        signatures = [program.export(f, arguments, symbol) for f, symbol in pairs]
        return program.module(), [_name_of(s.result) for s in signatures]

    with _making:
        if name not in _units:
            _units[name] = Unit(name, len(plain), write, cache_folder(), ready_name=ready_name)
        unit = _units[name]
    signatures = [Signature(arguments, _RESULTS[r]) for r in unit.results]
    return [Entry(unit, k, s) for k, s in enumerate(signatures)]


def _name_of(result: Scalar) -> str:
    if getattr(result, "name", "") not in _RESULTS:
        raise TypeError(f"a function that Python calls returns {result}; it may return one number")
    return result.name


def table_of(signature: Signature, functions: Sequence[Any]) -> Any:
    """Functions of one signature as compiled code calls them: by their addresses.

    Where kernels run as plain Python it is a list.
    """
    if not jit_is_on():
        return list(functions)
    entries: dict[Any, Entry] = {f: f for f in functions if isinstance(f, Entry)}
    rest = [f for f in functions if f not in entries]
    for module in dict.fromkeys(f.__module__ for f in rest):
        here = [f for f in rest if f.__module__ == module]
        entries.update(zip(here, entries_of(here, signature.arguments), strict=True))
    return Functions(signature, [entries[f] for f in functions])


def compiled(function):
    """Compile a function of the core at its first call, and keep the code for the next process."""
    return Compiled(function) if jit_is_on() else function


#: The same for a function that compiled code alone calls.
compiled_inside = compiled


def compiled_into(function):
    """The same for a function that is put into its callers, with the constants that they give."""
    return Compiled(function, is_inlined=True) if jit_is_on() else function


def _origin(functions: Sequence[Any]) -> list[str | bytes]:
    """What decides the code of functions: a digest of floors of the core, or their sources."""
    floors = {f.__module__.split(".")[1] if f.__module__.startswith("dap3d_core.") else ""
              for f in functions}  # fmt: skip
    if floors <= set(COMPILED_FLOORS):
        return [driver_digest(floor) for floor in sorted(floors)]
    return [*places(*functions), *sources(*functions)]


def reached(*functions) -> tuple[list, list[str]]:
    """The functions that these call, themselves included, and values of the constants they read.

    Follows names from function to function through their modules' globals; numpy and the
    standard library are left out.
    """
    found: dict[object, None] = {}
    constants: list[str] = []
    todo = list(functions)
    while todo:
        function = todo.pop()
        function = inspect.unwrap(function)
        if function in found:
            continue
        found[function] = None
        for name, value in _named_values(function):
            if isinstance(value, (types.FunctionType, Compiled)):
                if is_an_authors(inspect.unwrap(value).__code__.co_filename):
                    todo.append(value)
            elif isinstance(value, (bool, int, float, complex, str, tuple)):
                constants.append(f"{function.__qualname__}.{name}={value!r}")
    return list(found), constants


def sources(*functions) -> list[str | bytes]:
    """What decides what these functions compute: source files, constants, and names of modules.

    The names, because cached code imports its modules by name: a model's own file has another one
    in each folder. Of the files their own names alone, wherever a package stands.
    """
    found, constants = reached(*functions)
    files: dict[str, bytes] = {}
    for function in found:
        _add_file(files, function.__code__.co_filename)
    modules = sorted({function.__module__ for function in found})
    contents = sorted((Path(path).name, content) for path, content in files.items())
    return [*constants, *modules, *(part for both in contents for part in both)]


def places(*functions) -> list[str]:
    """Which functions of their files these are: variants of a type stand in one file."""
    codes = [function.__code__ for function in functions]
    return [f"{c.co_qualname} {c.co_firstlineno}" for c in codes]


def identities(*functions) -> list[str | bytes]:
    """The same, and their bytecode: a file may have changed since it was loaded."""
    return [*places(*functions), *(function.__code__.co_code for function in functions)]


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
        if isinstance(value, types.ModuleType) and is_an_authors(
            getattr(value, "__file__", None) or ""
        ):
            outside |= {f"{name}.{n}": getattr(value, n) for n in names if hasattr(value, n)}
    return sorted(outside.items())


@cache
def is_an_authors(filename: str) -> bool:
    """Whether a file is of the core or of a package of types, and not of Python or numpy."""
    standard = Path(os.__file__).parent
    path = Path(filename)
    if not filename.endswith(".py"):
        return False
    if "numpy" in path.parts:
        return False
    return not (path.is_relative_to(standard) and "site-packages" not in path.parts)


def _add_file(files, filename):
    if filename not in files:
        try:
            files[filename] = Path(filename).read_bytes()
        except OSError:  # typed at a prompt: no file, so nothing of it is kept between processes
            files[filename] = os.urandom(16)
