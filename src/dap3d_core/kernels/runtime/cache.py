"""The compiled functions of the core, and the folder that keeps compiled code.

Object files are named by a digest of *all* the sources that went into them: a change anywhere makes
another file (docs/decisions/0001, 0026).
"""

import functools
import inspect
import os
import stat
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.types import BOOL, FLOAT, INT, NOTHING, Scalar, Signature
from dap3d_core.kernels.compiler.units import Entry, Functions, Unit, kind_of, type_of
from dap3d_core.kernels.runtime.source_digest import bytecode, digest, origin, source_digest

_RESULTS = {type_.name: type_ for type_ in (NOTHING, BOOL, INT, FLOAT)}
_units: dict[str, Unit] = {}
#: Held while a unit is made, as several threads may need it at once.
_making = threading.RLock()
#: The thread in which the functions of the core run with symbols (compiler/straight_line.py).
_symbolic_thread: int | None = None
#: The bits of a mode that let others write.
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def jit_is_on() -> bool:
    """True if kernels are compiled; ``DAP3D_PLAIN=1`` runs them as plain Python."""
    return os.environ.get("DAP3D_PLAIN", "0") in ("", "0")


# ------------------------------------------------------------------ the folder


def cache_folder() -> Path | None:
    """The folder that keeps compiled code between processes, or None where there can be none.

    The first of these that can be written, and by this user alone: ``$DAP3D_CACHE_DIR``, the user's
    cache folder, a private folder for temporary files.
    """
    return _chosen()[0]


def cache_notes() -> tuple[str, ...]:
    """Folders that were passed over because others may write to them, and what to do."""
    return _chosen()[1]


@cache
def _chosen() -> tuple[Path | None, tuple[str, ...]]:
    notes = []
    for folder in _candidates():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if why := distrust(folder):
                notes.append(f"compiled code is not kept in {folder}, for what is there is run: "
                             f"{why}; DAP3D_CACHE_DIR names another folder")  # fmt: skip
                continue
            with tempfile.TemporaryFile(dir=folder):
                return folder, tuple(notes)
    return None, tuple(notes)


def _candidates() -> Iterator[Path]:
    if chosen := os.environ.get("DAP3D_CACHE_DIR"):
        yield Path(chosen)
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME")
    with suppress(RuntimeError):  # no home folder
        yield (Path(home) if home else Path.home() / ".cache") / "dap3d"
    user = os.getuid() if hasattr(os, "getuid") else "user"
    yield Path(tempfile.gettempdir()) / f"dap3d-{user}"


# ------------------------------------------------------------------ compiled functions


def compiled(function):
    """Compile a function of the core at its first call, and keep the code for the next process."""
    return Compiled(function) if jit_is_on() else function


def compiled_into(function):
    """The same for a function that is inlined into its callers, with the constants they pass."""
    return Compiled(function, is_inlined=True) if jit_is_on() else function


def prepared(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """A function of the core with its first arguments, to be called with the scalars after them.

    For many calls: types and addresses of the arguments are looked up once.
    """
    if isinstance(function, Compiled):
        return function.prepared(*arguments)
    return functools.partial(function, *arguments)


@contextmanager
def run_with_symbols() -> Iterator[None]:
    """Run functions of the core in this thread as plain Python, with symbols for numbers."""
    global _symbolic_thread
    with _making:
        _symbolic_thread = threading.get_ident()
        try:
            yield
        finally:
            _symbolic_thread = None


class Compiled:
    """A function of the core, compiled for the types that it is called with.

    Attributes:
        is_inlined: True if it is inlined into its callers, once more for each constant they pass.
    """

    def __init__(self, function: Callable[..., Any], is_inlined: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.is_inlined = is_inlined
        self._parameters = list(inspect.signature(function).parameters.values())
        self._entries: dict[Any, Entry] = {}
        self._quick: dict[Any, Entry] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Call the code for the types of these arguments; the Python function with symbols."""
        if _symbolic_thread is not None and _symbolic_thread == threading.get_ident():
            return self.__wrapped__(*arguments)
        for parameter in self._parameters[len(arguments) :]:
            arguments += (parameter.default,)
        key = tuple([kind_of(a) for a in arguments])
        entry = self._quick.get(key)
        if entry is None:
            entry = self._quick[key] = self.compile([type_of(a) for a in arguments])
        return entry.unchecked(*arguments)

    def prepared(self, *arguments: Any) -> Callable[..., Any]:
        """As ``prepared``."""
        rest = [FLOAT if p.annotation is float else INT for p in self._parameters[len(arguments) :]]
        return self.compile([type_of(a) for a in arguments] + rest).prepared(*arguments)

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
    if all(f.__module__.startswith("dap3d_core.") for f in functions):
        return list(_entries_of_core(tuple(functions), arguments))
    return _entries_of(functions, arguments)  # their constants may be others the next time


@cache
def _entries_of_core(functions: tuple[Any, ...], arguments: tuple[Any, ...]) -> list[Entry]:
    return _entries_of(functions, arguments)


def _entries_of(functions: Sequence[Any], arguments: tuple[Any, ...]) -> list[Entry]:
    plain = [inspect.unwrap(f) for f in functions]
    parts = [f"{f.__module__}.{f.__qualname__}" for f in plain]
    label = f"{plain[0].__module__.split('.')[-1]}.{plain[0].__name__}"
    ready_name, name = names_of(label, plain, repr(arguments), *parts, *origin(plain))

    def write(symbols: list[str]) -> tuple[str, list[str]]:
        program = Program()
        pairs = zip(functions, symbols, strict=True)
        signatures = [program.export(f, arguments, symbol) for f, symbol in pairs]
        return program.module(), [_name_of(s.result) for s in signatures]

    unit = unit_of(name, len(plain), write, ready_name=ready_name)
    signatures = [Signature(arguments, _RESULTS[r]) for r in unit.results]
    return [Entry(unit, k, s) for k, s in enumerate(signatures)]


def unit_of(
    name: str, count: int, write: Any, *, optimise: bool = False, ready_name: str = ""
) -> Unit:
    """A unit of so many functions, made once in a process; arguments as of ``Unit``."""
    with _making:
        if name not in _units:
            _units[name] = Unit(name, count, write, cache_folder(), optimise, ready_name)
        return _units[name]


def _name_of(result: Scalar) -> str:
    if getattr(result, "name", "") not in _RESULTS:
        raise TypeError(f"a function that Python calls returns {result}; it may return one number")
    return result.name


def names_of(label: str, functions: Sequence[Any], *parts: str | bytes) -> tuple[str, str]:
    """Name of a unit among ready-made objects, and in the cache folder.

    Ready-made objects hold for any Python, LLVM and processor: their digest is of sources and of
    this compiler. The digest of the cache has these as well, and the bytecode of functions: a file
    may have changed since it was loaded.

    Args:
        label: how both begin.
        functions: those of the unit.
        parts: digests, sources and names that decide the code.
    """
    ready = source_digest(*parts, objects.compiler())
    codes = [part for function in functions for part in bytecode(function)]
    return f"{label}-{ready}", f"{label}-{digest(ready, *codes, objects.identity())}"


def table_of(signature: Signature, functions: Sequence[Any], *, values_alone: bool = False) -> Any:
    """A table of functions of one signature for compiled code; in plain Python a list.

    values_alone: what they compute needs no derivatives in differentiated code (lanes.py).
    """
    if not jit_is_on():
        return list(functions)
    entries: dict[Any, Entry] = {f: f for f in functions if isinstance(f, Entry)}
    rest = [f for f in functions if f not in entries]
    for module in dict.fromkeys(f.__module__ for f in rest):
        here = [f for f in rest if f.__module__ == module]
        entries.update(zip(here, entries_of(here, signature.arguments), strict=True))
    return Functions(signature, [entries[f] for f in functions], values_alone)


def distrust(folder: Path) -> str:
    """Reason why others could put code into a folder; "" if only this user can.

    A trusted folder belongs to this user, nobody else may write to it, and no folder above it lets
    everybody rename its content. Where files have no owners (Windows), every folder is trusted.

    Raises:
        OSError: the folder cannot be examined.
    """
    if not hasattr(os, "geteuid"):
        return ""
    user = os.geteuid()
    for status in (folder.lstat(), folder.stat()):  # a link, and where it leads
        if status.st_uid != user:
            return f"it belongs to another user (uid {status.st_uid})"
    mode = stat.S_IMODE(folder.stat().st_mode)
    if mode & OTHERS_WRITE:
        return f"others may write to it (mode {mode:o}); chmod go-w makes it yours alone"
    for above in folder.resolve().parents:
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"everybody may rename what is in {above}"
    return ""
