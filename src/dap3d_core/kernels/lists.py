"""Typed lists of first-class functions: what the driver did not know when it was compiled.

A typed list filled from Python would be compiled anew in each process (0.3 s); these are made by
two cached functions of known signature. Where kernels run as plain Python the list is a plain list.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs
from numba import float64, int64, types
from numba.typed import List

from dap3d_core.kernels.by_address import INTEGERS, MATRIX, VECTOR, Arrays, pointer
from dap3d_core.kernels.cache import compiled, jit_is_on


@attrs.frozen(eq=False, kw_only=True, slots=False)
class LoopArrays(Arrays):
    """What every group loop reads; the driver's system begins with it."""

    types: ClassVar[dict[str, Any]] = {"body": MATRIX, "F": MATRIX, "idx": INTEGERS}

    body: Any  # (n+1, BODY_WIDTH) state and constants of each body (gather.py)
    F: Any  # (functions+1, 5) functions of time, at t and (the last column) at 0
    idx: Any  # integers of all instances
    par: Any  # numbers of all instances


_OUT = types.CPointer(float64)
#: Signature of every group loop (loops.py).
LOOP = types.void(float64, LoopArrays.type_of(), int64, int64, int64, _OUT, _OUT, _OUT)
LOOP_TYPE = types.FunctionType(LOOP)
LOOP_LIST = types.ListType(LOOP_TYPE)
#: A Python integer as an argument.
INTEGER = int64


def procedure_signature(*arguments: Any) -> Any:
    """Signature of a function of these arguments that returns nothing."""
    return types.void(*arguments)


def step_signature(system: Any) -> Any:
    """Signature of a formulation's functions: (t, y, out, system, loops)."""
    return procedure_signature(float64, VECTOR, VECTOR, system, LOOP_LIST)


def number_signature(*arguments: Any) -> Any:
    """Signature of a function of two numbers and these arguments that returns a number."""
    return types.float64(float64, float64, *arguments)


def function_type(signature: Any) -> Any:
    """The type of a first-class function of a signature."""
    return types.FunctionType(signature)


def list_type(item: Any) -> Any:
    """The type of a typed list."""
    return types.ListType(item)


#: Held while the two functions that make a list are compiled.
_preparing = threading.Lock()


def fill(
    empty: Callable[[], Any], append: Callable[..., None], item: Any, functions: Sequence[Callable]
) -> Any:
    """A typed list of functions, by ``empty`` and ``append`` compiled for this item type alone."""
    if not jit_is_on():
        return list(functions)
    with _preparing:
        if not empty.signatures:
            empty.compile(types.ListType(item)())
            append.compile(types.void(types.ListType(item), item))
            append.disable_compile()  # else each function's own type would be compiled for
    result = empty()
    for function in functions:
        append(result, function)
    return result


@compiled
def _empty():
    return List.empty_list(LOOP_TYPE)


@compiled
def _append(loops, loop):
    loops.append(loop)


def loop_list(loops: Sequence[Callable]) -> Any:
    """Group loops as the one list that the driver takes as an argument of its own."""
    return fill(_empty, _append, LOOP_TYPE, loops)


@compiled
def call_loop(
    loops: Any, q: int, t: float, arrays: Any, group: Any, out1: Any, out2: Any, out3: Any
) -> None:
    """Call one group loop, with arrays and a group (i0, p0, count) of the caller's."""
    loop = loops[q]
    loop(t, arrays, group[0], group[1], group[2], pointer(out1), pointer(out2), pointer(out3))


__all__ = [
    "INTEGER",
    "LOOP",
    "LOOP_LIST",
    "LOOP_TYPE",
    "List",
    "LoopArrays",
    "call_loop",
    "fill",
    "function_type",
    "list_type",
    "loop_list",
    "number_signature",
    "procedure_signature",
    "step_signature",
]
