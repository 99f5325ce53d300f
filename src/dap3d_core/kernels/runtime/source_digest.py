"""Digests of the sources that decide compiled code, and the functions that a kernel reaches."""

import builtins
import dis
import hashlib
import inspect
import os
import sys
import types
from collections.abc import Callable, Collection, Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from dap3d_core.kernels.compiler.types import CompileError

#: Layers of the core that hold compiled code, low to high: a function depends on its own layer and
#: those below.
COMPILED_LAYERS = ("kernels", "model", "assembly", "linear", "formulations", "integrators", "study")

#: Modules of others whose functions depend on their arguments alone.
PURE = {"builtins", "cmath", "functools", "itertools", "math", "numpy", "operator", "dap3d_core"}
#: Functions of Python that do not.
IMPURE = {"__import__", "breakpoint", "compile", "eval", "exec", "globals", "input", "locals",
          "open", "print", "vars"}  # fmt: skip
_CHANGES = {"IMPORT_NAME": "imports", "STORE_GLOBAL": "changes", "DELETE_GLOBAL": "removes"}


def source_digest(*parts: str | bytes) -> str:
    """Digest of sources alone."""
    seal = hashlib.sha256()
    for part in parts:
        seal.update(part.encode() if isinstance(part, str) else part)
        seal.update(b"\0")
    return seal.hexdigest()[:20]


def digest(*parts: str | bytes) -> str:
    """Digest of sources and of the Python version that reads them."""
    return source_digest(*parts, f"{sys.version_info[:2]}")


@cache
def driver_digest(layer: str) -> str:
    """Digest of all sources that decide what the compiled code of a layer of the core computes."""
    k = COMPILED_LAYERS.index(layer)
    below = driver_digest(COMPILED_LAYERS[k - 1]) if k else ""
    root = os.path.join(Path(__file__).parents[2], layer)
    files = sorted(
        os.path.join(folder, name)
        for folder, _, names in os.walk(root)
        for name in names
        if name.endswith(".py")
    )
    parts = ((f.removeprefix(root).replace(os.sep, "/"), Path(f).read_bytes()) for f in files)
    return source_digest(below, *(part for both in parts for part in both))


def origin(functions: list[Any]) -> list[str | bytes]:
    """Digests of all that determines the code of functions: layers of the core, or sources."""
    layers = {f.__module__.split(".")[1] if f.__module__.startswith("dap3d_core.") else ""
              for f in functions}  # fmt: skip
    if layers <= set(COMPILED_LAYERS):
        return [driver_digest(layer) for layer in sorted(layers)]
    return [*places(*functions), *sources(*functions)]


def reached(*functions) -> tuple[list, list[str]]:
    """The functions that these call, themselves included, and values of the constants they read.

    Follows names from function to function through their modules' globals; numpy and the standard
    library are left out.
    """
    visited: dict[object, None] = {}
    constants: list[str] = []
    todo = list(functions)
    while todo:
        function = inspect.unwrap(todo.pop())
        if function in visited:
            continue
        visited[function] = None
        todo += getattr(function, "kernels", ())  # of which it was made
        for name, value in _named_values(function):
            plain = inspect.unwrap(value) if callable(value) else value
            if isinstance(plain, types.FunctionType):
                if is_an_authors(plain.__code__.co_filename):
                    todo.append(plain)
            elif isinstance(value, (bool, int, float, complex, str, tuple)):
                constants.append(f"{function.__qualname__}.{name}={value!r}")
    return list(visited), constants


def _named_values(function) -> list[tuple[str, Any]]:
    """Names that a function reads from outside itself, with values; one step through modules."""
    names = _names_in(function)
    cells = (cell.cell_contents for cell in function.__closure__ or ())
    outer = dict(zip(function.__code__.co_freevars, cells, strict=True))
    outer |= {n: function.__globals__[n] for n in names if n in function.__globals__}
    for name, value in list(outer.items()):
        file = getattr(value, "__file__", None) if isinstance(value, types.ModuleType) else None
        if is_an_authors(file or ""):
            outer |= {f"{name}.{n}": getattr(value, n) for n in names if hasattr(value, n)}
    return sorted(outer.items())


@lru_cache(maxsize=4096)  # scenes make functions of their own
def _names_in(function) -> list[str]:
    """The names in a function and in those within it, sorted."""
    return sorted({name for code in codes_in(function.__code__) for name in code.co_names})


@cache
def is_an_authors(filename: str) -> bool:
    """True if a file is of the core or of a package of types, not of Python or numpy."""
    path, standard = Path(filename), Path(os.__file__).parent
    if not filename.endswith(".py") or "numpy" in path.parts:
        return False
    return not path.is_relative_to(standard) or "site-packages" in path.parts


def sources(*functions) -> list[str | bytes]:
    """All that determines the results of functions: source files, constants, names of modules.

    Names of modules, because cached code imports them by name: a model's own file has another one
    in each folder. Files are ordered by name and content, wherever a package is installed.
    """
    return sources_of(*reached(*functions))


def sources_of(functions: Collection[Any], constants: list[str]) -> list[str | bytes]:
    """The same of the functions that some reach, and of the constants that they read."""
    modules = sorted({function.__module__ for function in functions})
    paths = dict.fromkeys(function.__code__.co_filename for function in functions)
    files = sorted((Path(path).name, _content(path)) for path in paths)
    return [*constants, *modules, *(part for both in files for part in both)]


def _content(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError:  # typed at a prompt: nothing of it is kept between processes
        return os.urandom(16)


def places(*functions) -> list[str]:
    """Name and line of functions: a file may define variants of a type."""
    codes = [function.__code__ for function in functions]
    return [f"{c.co_qualname} {c.co_firstlineno}" for c in codes]


def identities(*functions) -> list[str | bytes]:
    """The same, and their bytecode: a file may have changed since it was loaded."""
    return [*places(*functions), *(part for f in functions for part in bytecode(f))]


@lru_cache(maxsize=4096)
def bytecode(function) -> tuple[str | bytes, ...]:
    """Instructions of a function and of those within it, with the names and constants in them."""
    parts: list[str | bytes] = []
    for code in codes_in(function.__code__):
        parts += [code.co_code, repr(code.co_names)]
        for constant in code.co_consts:
            if isinstance(constant, frozenset):  # its order is another one in each process
                parts.append(repr(sorted(map(repr, constant))))
            elif not isinstance(constant, types.CodeType):
                parts.append(repr(constant))
    return tuple(parts)


def refuse_outer_references(*kernels: Callable[..., Any]) -> None:
    """Examine kernels, and the functions of their authors that they call.

    Raises:
        CompileError: one reaches what is not made of its arguments; names the line.
    """
    for function in reached(*kernels)[0]:
        if (function.__module__ or "").partition(".")[0] == "dap3d_core":
            continue
        for code in codes_in(function.__code__):
            line = code.co_firstlineno
            for step in dis.get_instructions(code):
                line = step.positions.lineno or line if step.positions else line
                if why := _reason(function, step):
                    raise CompileError(
                        f"it {why}; a kernel is made of its arguments alone (DAP3D_PLAIN=1 "
                        f"runs it as it stands) [{code.co_filename}:{line}]"
                    )


def codes_in(code: types.CodeType) -> Iterator[types.CodeType]:
    """A code object and those of the functions within it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            yield from codes_in(inner)


def _reason(function: Any, step: dis.Instruction) -> str:
    name = step.argval
    if step.opname in _CHANGES:
        return f"{_CHANGES[step.opname]} {name}"
    if step.opname == "LOAD_ATTR" and name == "random":
        return "draws random numbers"
    if step.opname not in ("LOAD_GLOBAL", "LOAD_NAME"):
        return ""
    if name not in function.__globals__:
        return f"calls {name}" if name in IMPURE and hasattr(builtins, name) else ""
    value = function.__globals__[name]
    if value in getattr(function, "kernels", ()):  # examined on their own
        return ""
    if isinstance(value, types.ModuleType):
        module, file = value.__name__, getattr(value, "__file__", None) or ""
    elif isinstance(value, types.FunctionType):
        module, file = value.__module__ or "", value.__code__.co_filename
    elif isinstance(value, types.BuiltinFunctionType):
        module, file = value.__module__ or "", ""
    else:
        return ""
    return "" if is_an_authors(file) or module.partition(".")[0] in PURE else f"uses {name}"
