"""Typed lists of first-class functions: what the driver did not know when it was compiled.

A typed list filled from Python would be compiled anew in each process (0.3 s); these are made by
two cached functions of known signature. Where kernels run as plain Python the list is a plain list.
"""

from collections.abc import Callable, Sequence
from typing import Any

from numba import complex128, float64, int64, types
from numba.typed import List

from dap3d_core.kernels.cache import compiled, jit_is_on

VECTOR, MATRIX = types.Array(float64, 1, "C"), types.Array(float64, 2, "C")
INTEGERS, INTEGER_MATRIX = types.Array(int64, 1, "C"), types.Array(int64, 2, "C")
TENSOR, COMPLEX_VECTOR = types.Array(float64, 3, "C"), types.Array(complex128, 1, "C")

#: Signature of every group loop (loops.py).
LOOP = types.void(
    float64, MATRIX, MATRIX, INTEGERS, VECTOR, int64, int64, int64, VECTOR, VECTOR, VECTOR
)
LOOP_TYPE = types.FunctionType(LOOP)
LOOP_LIST = types.ListType(LOOP_TYPE)


def named_tuple_type(class_: type, members: Sequence[Any]) -> Any:
    """The compiled code's type of a NamedTuple of arrays; the class must be importable."""
    return types.NamedTuple(list(members), class_)


def step_signature(system: Any) -> Any:
    """Signature of a formulation's functions: (t, y, out, system, loops)."""
    return types.void(float64, VECTOR, VECTOR, system, LOOP_LIST)


def number_signature(*arguments: Any) -> Any:
    """Signature of a function of two numbers and these arguments that returns a number."""
    return types.float64(float64, float64, *arguments)


def function_type(signature: Any) -> Any:
    """The type of a first-class function of a signature."""
    return types.FunctionType(signature)


def list_type(item: Any) -> Any:
    """The type of a typed list."""
    return types.ListType(item)


def fill(
    empty: Callable[[], Any], append: Callable[..., None], item: Any, functions: Sequence[Callable]
) -> Any:
    """A typed list of functions, by ``empty`` and ``append`` compiled for this item type alone."""
    if not jit_is_on():
        return list(functions)
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


__all__ = [
    "COMPLEX_VECTOR",
    "INTEGERS",
    "INTEGER_MATRIX",
    "LOOP",
    "LOOP_LIST",
    "LOOP_TYPE",
    "MATRIX",
    "TENSOR",
    "VECTOR",
    "List",
    "fill",
    "function_type",
    "list_type",
    "loop_list",
    "named_tuple_type",
    "number_signature",
    "step_signature",
]
