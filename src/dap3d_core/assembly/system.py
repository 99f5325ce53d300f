"""The system: every array that the compiled driver works on.

Made from a model and its elimination plan (formulations/build.py). The arrays are one named tuple,
which costs little to pass; the loops are an argument of their own (docs/decisions/0001).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.cache import compiled, jit_is_on
from dap3d_core.kernels.lists import (
    INTEGER_MATRIX,
    INTEGERS,
    MATRIX,
    VECTOR,
    List,
    fill,
    function_type,
    named_tuple_type,
    step_signature,
)

#: The order of the group loops in the list: all loops of one kind stand together.
KINDS = ("value", "wrench", "energy", "acceleration", "position")
VALUE, WRENCH, ENERGY, ACCELERATION, POSITION = range(len(KINDS))


class System(NamedTuple):
    """Arrays of the driver. n bodies, ground is 0; rows in the order of the plan."""

    body: NDArray[np.float64]  # (n+1, BODY_WIDTH) state and constants of each body (kernels/gather.py)
    metric: NDArray[np.float64]  # (n+1, 16): 1/sqrt(m); U = L^-T by rows, upper triangle; B = A U by rows
    F: NDArray[np.float64]  # (functions+1, 4) functions of time
    par: NDArray[np.float64]  # numbers of all instances
    force: NDArray[np.float64]  # (6 (n+1),) force and moment on each body; then the acceleration
    gamma: NDArray[np.float64]  # (rows,)
    nu: NDArray[np.float64]  # (rows,)
    C: NDArray[np.float64]  # (rows,)
    x: NDArray[np.float64]  # (rows,) right-hand side, then -lambda
    D: NDArray[np.float64]  # blocks of the Jacobian
    K: NDArray[np.float64]  # blocks of what remains to be factored
    smallest: NDArray[np.float64]  # (rows,) a pivot not above this is singular
    settings: NDArray[np.float64]  # projection tolerances at position and velocity level; a scratch number
    idx: NDArray[np.int64]  # integers of all instances
    groups: NDArray[np.int64]  # (loops, 3) i0, p0, count
    kinds: NDArray[np.int64]  # (KINDS + 1,) first loop of each kind
    row: NDArray[np.int64]  # (model rows,) place of each constraint row in the row vectors
    blocks: NDArray[np.int64]  # from here on as in linear.Plan
    targets: NDArray[np.int64]
    contributions: NDArray[np.int64]
    nodes: NDArray[np.int64]
    columns: NDArray[np.int64]
    updates: NDArray[np.int64]
    hubs: NDArray[np.int64]


_matrices = ("body", "metric", "F")
_integers = ("idx", "kinds", "row")
_floats = ("par", "force", "gamma", "nu", "C", "x", "D", "K", "smallest", "settings")


def _member_type(name: str) -> Any:
    if name in _matrices:
        return MATRIX
    if name in _floats:
        return VECTOR
    return INTEGERS if name in _integers else INTEGER_MATRIX


SYSTEM = named_tuple_type(System, [_member_type(name) for name in System._fields])
STEP = step_signature(SYSTEM)
STEP_TYPE = function_type(STEP)


@compiled
def _empty():
    return List.empty_list(STEP_TYPE)


@compiled
def _append(functions, function):
    functions.append(function)


def step_functions(*functions: Callable[..., None]) -> Any:
    """A formulation's functions (t, y, out, system, loops) as the list that an integrator takes."""
    if jit_is_on():
        for function in functions:
            function.compile(STEP)
    return fill(_empty, _append, STEP_TYPE, functions)
