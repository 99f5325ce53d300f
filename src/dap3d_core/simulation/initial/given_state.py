"""States that a script gives: numbers of the right shape and kind, or an error that says so."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import STATE, split, state_layout


def state_of(u: ArrayLike, body_names: Sequence[str], states: int = 0) -> Floats:
    """A state as an array of its own, (13 n,) of float64; with as many states of elements last.

    Raises:
        ValueError: it is not 13 n finite numbers, or Euler parameters of a body are all zero.
    """
    size = state_layout(len(body_names)).size
    count = size + states
    more = f" and {states} states of elements" if states else ""
    wanted = f"u must be {count} finite numbers, {STATE} a body{more}"
    try:
        given = np.asanyarray(u)
    except (ValueError, TypeError) as error:  # lists of different lengths
        raise ValueError(f"{wanted}: {error}") from error
    if given.dtype.kind not in "iuf":
        raise ValueError(f"{wanted}, not {given.dtype}")
    if given.shape != (count,):
        raise ValueError(f"{wanted}; its shape is {given.shape}")
    if np.ma.is_masked(given):
        raise ValueError(f"{wanted}; entry {_first(np.ma.getmaskarray(given))} is masked")
    state = np.array(given, dtype=float, subok=False)
    if not np.all(np.isfinite(state)):
        first = _first(~np.isfinite(state))
        raise ValueError(f"{wanted}; entry {first} is {state[first]}")
    without = ~np.any(split(state[:size])[1], axis=1)
    if np.any(without):
        name = body_names[_first(without)]
        raise ValueError(f"the Euler parameters of body {name} in u are all zero")
    return state


def time_of(t: Any) -> float:
    """A time in s.

    Raises:
        ValueError: it is not one finite number.
    """
    number = np.asarray(t)
    if number.shape or number.dtype.kind not in "iuf" or not np.isfinite(number):
        raise ValueError(f"t must be a finite number, not {t!r}")
    return float(number)


def _first(where: NDArray[np.bool_]) -> int:
    return int(np.flatnonzero(where)[0])
