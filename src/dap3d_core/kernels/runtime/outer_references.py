"""What a kernel may not reach: a trace would keep for ever what it was once told.

The clock, random numbers, files, names of its module that it changes: none is made of arguments.
"""

import builtins
import dis
import types
from collections.abc import Callable, Iterator
from typing import Any

from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.runtime.cache import is_an_authors, reached

#: Modules of others whose functions are made of their arguments alone.
PURE = {"builtins", "cmath", "functools", "itertools", "math", "numpy", "operator", "dap3d_core"}
#: Functions of Python that are not.
IMPURE = {"__import__", "breakpoint", "compile", "eval", "exec", "globals", "input", "locals",
          "open", "print", "vars"}  # fmt: skip
_CHANGES = {"IMPORT_NAME": "imports", "STORE_GLOBAL": "changes", "DELETE_GLOBAL": "removes"}


def refuse_what_is_outside(*kernels: Callable[..., Any]) -> None:
    """Look through kernels, and what they call of the author's.

    Raises:
        CompileError: one reaches what is not made of its arguments; names the line.
    """
    for function in reached(*kernels)[0]:
        if (function.__module__ or "").partition(".")[0] == "dap3d_core":
            continue
        for code in _codes(function.__code__):
            line = code.co_firstlineno
            for step in dis.get_instructions(code):
                line = step.positions.lineno or line if step.positions else line
                if why := _why(function, step):
                    raise CompileError(
                        f"it {why}; a kernel is made of its arguments alone (DAP3D_PLAIN=1 "
                        "runs it as it stands) "
                        f"[{code.co_filename}:{line}]"
                    )


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            yield from _codes(inner)


def _why(function: Any, step: dis.Instruction) -> str:
    name = step.argval
    if step.opname in _CHANGES:
        return f"{_CHANGES[step.opname]} {name}"
    if step.opname not in ("LOAD_GLOBAL", "LOAD_NAME"):
        return "" if step.opname != "LOAD_ATTR" or name != "random" else "draws random numbers"
    if name not in function.__globals__:
        return f"calls {name}" if name in IMPURE and hasattr(builtins, name) else ""
    value = function.__globals__[name]
    if isinstance(value, types.ModuleType):
        home, is_own = value.__name__, is_an_authors(getattr(value, "__file__", None) or "")
    elif isinstance(value, (types.FunctionType, types.BuiltinFunctionType)):
        home, is_own = value.__module__ or "", isinstance(value, types.FunctionType)
        is_own = is_own and is_an_authors(value.__code__.co_filename)
    else:
        return ""
    return "" if is_own or home.partition(".")[0] in PURE else f"uses {name}"
