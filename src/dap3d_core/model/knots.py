"""Arguments at which functions change their form, as ``breaks`` of their types gives them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import Function
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene import Instance

#: Knots of a function without any, next to functions that have some.
BEYOND_ALL_KNOTS = 1e100


def breaks_of(function: Instance) -> Floats:
    """Arguments at which a function takes another form, as its type says: finite numbers.

    Raises:
        PluginError: ``breaks`` of the type failed.
    """
    if function.terms:
        return np.concatenate([breaks_of(term) for term in function.terms])
    type_: Any = function.type_info.type
    fields = specs_of(type_)
    thing = type_(**{n: v for n, v in function.values.items() if n in fields})
    try:
        found = np.asarray(thing.breaks(), dtype=float).ravel()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise PluginError(f"{where_is(type_)}.breaks failed: {reason}") from error
    return found[np.isfinite(found)]


def breaks_are_told(function: Instance) -> bool:
    """True if the type of a function gives its breaks, or says that it has none."""
    if function.terms:
        return all(map(breaks_are_told, function.terms))
    type_: Any = function.type_info.type
    return bool(type_.smooth) or type_.breaks is not Function.breaks


def knots_of(functions: Sequence[Instance]) -> Floats:
    """(functions, k) their breaks, in order; the last one again where another function has more.

    Of a function without any, among others that have some, they are BEYOND_ALL_KNOTS away.
    """
    found = [np.unique(breaks_of(function)) for function in functions]
    count = max(map(len, found))
    knots = np.full((len(found), count), BEYOND_ALL_KNOTS)
    for row, own in zip(knots, found, strict=True):
        if len(own):
            row[:] = own[-1]
            row[: len(own)] = own
    return knots


def narrowest(knots: Floats) -> float:
    """The least distance of two knots that differ; of a single one its own size."""
    own = np.unique(knots[knots < BEYOND_ALL_KNOTS])
    if len(own) > 1:
        return float(np.min(np.diff(own)))
    return float(np.max(np.abs(own), initial=0.0))
