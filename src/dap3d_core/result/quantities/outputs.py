"""Outputs of a scene: quantities that are expressions of others."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import read_only
from dap3d_core.result.arrays import AXES
from dap3d_core.result.errors import ResultError
from dap3d_core.result.quantities.catalogue import Quantity
from dap3d_core.scene.expressions.expression import Expression, ExpressionError
from dap3d_core.scene.expressions.units import UNKNOWN, Unit, contradiction, text_of, unit_of


def output_quantity(
    name: str, expression: Expression, operands: Mapping[str, Quantity], shape: tuple[int, ...]
) -> Quantity:
    """The quantity of an output.

    Args:
        name: of the output.
        expression: of quantities.
        operands: each of them by name.
        shape: (nt,).

    Returns:
        A scalar (nt,), or a vector (nt, components); NaN where it has no finite value.

    Raises:
        ResultError: a function of vectors has numbers, vectors have different components, unlike
            units are added.
    """
    try:
        values = expression.evaluate({n: q.values for n, q in operands.items()})
        unit, exact = _unit(expression, operands)
    except ExpressionError as error:
        raise ResultError(f"the output {name}: {error}") from error
    if not values.ndim:
        values = np.full(shape, values)
    components = _components(operands, values)
    return Quantity(name, read_only(values), name, name, unit, components, "output", "",
                    tuple(operands), exact)  # fmt: skip


def note_of_undefined(output: Quantity, operands: Iterable[Quantity], t: Floats) -> str:
    """The note on instants where an output has no value though all operands have; "" for none."""
    undefined = _is_nan(output)
    for operand in operands:
        undefined &= ~_is_nan(operand)
    if not np.any(undefined):
        return ""
    first, count = t[undefined][0], np.count_nonzero(undefined)
    return (
        f"output {output.name} has no finite value at {count} of {len(t)} instants, first at "
        f"t = {first:g} s: a division by zero, or a function beyond its domain"
    )


def _is_nan(quantity: Quantity) -> Any:
    """(nt,) True where a component is NaN."""
    is_nan = np.isnan(quantity.values)
    return is_nan.any(axis=1) if is_nan.ndim > 1 else is_nan


def _components(operands: Mapping[str, Quantity], values: Any) -> tuple[str, ...]:
    """Names of the columns: of the first operand that has as many."""
    if values.ndim == 1:
        return ()
    count = values.shape[1]
    names = (q.components for q in operands.values() if len(q.components) == count)
    return next(names, AXES)


def _unit(expression: Expression, operands: Mapping[str, Quantity]) -> tuple[str, bool]:
    """The unit of an expression, as declared or as computed, and whether that is certain."""
    units = {
        name: UNKNOWN if one.owner == "input" else unit_of(one.unit, exact=one.exact)
        for name, one in operands.items()
    }
    carried = expression.carried_unit(units)
    if expression.unit:
        if fault := contradiction(expression.unit, carried):
            raise ExpressionError(f"{fault}; convert the value, as angle/deg or x/mm")
        return expression.unit, True
    return text_of(carried), not isinstance(carried, Unit) or carried.exact
