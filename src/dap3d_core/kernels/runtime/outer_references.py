"""Refusal of kernels that reach what is not made of their arguments.

The clock, random numbers, files, names of its module that a kernel changes: a trace would keep
their values for ever.
"""

import builtins
import dis
import types
from collections.abc import Callable, Iterator
from typing import Any

from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.runtime.source_digest import is_an_authors, reached

#: Modules of others whose functions depend on their arguments alone.
PURE = {"builtins", "cmath", "functools", "itertools", "math", "numpy", "operator", "dap3d_core"}
#: Functions of Python that do not.
IMPURE = {"__import__", "breakpoint", "compile", "eval", "exec", "globals", "input", "locals",
          "open", "print", "vars"}  # fmt: skip
_CHANGES = {"IMPORT_NAME": "imports", "STORE_GLOBAL": "changes", "DELETE_GLOBAL": "removes"}


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
