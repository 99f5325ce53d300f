"""Functions and constants of MATLAB that expressions may use."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from dap3d_matlab.language.operators import RefusalError, check_size, checked
from dap3d_matlab.language.values import LARGEST_MATRIX, Numbers

if TYPE_CHECKING:
    from tree_sitter import Node

CONSTANTS = {"pi": math.pi}

#: Functions of each element of a matrix.
_ELEMENTWISE: dict[str, Callable[[Numbers], Numbers]] = {
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "exp": np.exp,
    "deg2rad": np.deg2rad,
}
_FILLED: dict[str, Callable[[int, int], Numbers]] = {
    "zeros": lambda rows, columns: np.zeros((rows, columns)),
    "ones": lambda rows, columns: np.ones((rows, columns)),
    "eye": lambda rows, columns: np.eye(rows, columns),
}
FUNCTIONS = (*_ELEMENTWISE, "atan2", "norm", "diag", *_FILLED)


def call(name: str, values: list[Numbers], node: "Node") -> Numbers:
    """The value of one of ``FUNCTIONS``.

    Raises:
        RefusalError: the arguments do not fit, or the value is not finite and real.
    """
    if name in _FILLED:
        return _filled(name, values, node)
    count = 2 if name == "atan2" else 1
    if len(values) != count:
        words = "one argument" if count == 1 else f"{count} arguments"
        raise RefusalError(node, f"the function {name} takes {words} here")
    with np.errstate(all="ignore"):
        if name in _ELEMENTWISE:
            return checked(_ELEMENTWISE[name](values[0]), node)
        if name == "atan2":
            if values[0].shape != values[1].shape:
                raise RefusalError(node, "the arguments of atan2 have different sizes")
            return checked(np.arctan2(*values), node)
        if name == "norm":
            if min(values[0].shape) != 1:
                raise RefusalError(node, "norm takes a vector here")
            return checked(np.array([[float(np.linalg.norm(values[0]))]]), node)
    vector = values[0]
    if min(vector.shape) != 1 or vector.size > 10:
        raise RefusalError(node, "diag takes a vector here")
    return np.diag(vector.ravel())


def _filled(name: str, values: list[Numbers], node: "Node") -> Numbers:
    sizes = [v for value in values for v in value.ravel().tolist()] or [1.0]
    if len(sizes) > 2 or not all(s.is_integer() and 0 <= s <= LARGEST_MATRIX for s in sizes):
        raise RefusalError(node, f"the function {name} takes one or two sizes here")
    rows, columns = int(sizes[0]), int(sizes[-1])
    check_size(rows * columns, node)
    return _FILLED[name](rows, columns)
