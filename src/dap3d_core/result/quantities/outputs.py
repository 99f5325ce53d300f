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

#: Functions whose value has no dimension, is an angle, has the unit of their arguments.
PURE = {"sin", "cos", "tan", "exp", "log", "tanh",
        "<", "<=", ">", ">=", "==", "!=", "and", "or", "not"}  # fmt: skip
ANGLES = {"asin", "acos", "atan2"}
ALIKE = {"+", "-", "%", "neg", "abs", "floor", "norm", "hypot", "minimum", "maximum", "where"}
#: Unit of what depends on the expression; unit of a number without dimension.
UNKNOWN, NONE = "SI", "1"


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
        ResultError: a function of vectors has numbers, vectors have different components.
    """
    try:
        values = expression.evaluate({n: q.values for n, q in operands.items()})
    except ExpressionError as error:
        raise ResultError(f"the output {name}: {error}") from error
    if not values.ndim:
        values = np.full(shape, values)
    components = _components(operands, values)
    unit = _unit(expression, operands)
    return Quantity(name, read_only(values), name, name, unit, components, "output", "",
                    tuple(operands))  # fmt: skip


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


def _unit(expression: Expression, operands: Mapping[str, Quantity]) -> str:
    """The unit of an expression where sums and simple products tell it, else "SI"."""
    unit = expression.fold(lambda name: operands[name].unit, _unit_of_call)
    return unit if isinstance(unit, str) else NONE  # of a number


def _unit_of_call(word: str, *arguments: str | float) -> str:
    """The unit of a call, from those of its arguments; a number has any."""
    if word in PURE:
        return NONE
    if word in ANGLES:
        return "rad"
    values = arguments[1:] if word == "where" else arguments
    units = {unit for unit in values if isinstance(unit, str)}
    dimensions = [unit for unit in values if isinstance(unit, str) and unit != NONE]
    if not dimensions:
        return NONE
    first = dimensions[0]
    if word in ALIKE:
        return first if units == {first} else UNKNOWN
    if word == "*" and len(dimensions) == 1:
        return first
    if word == "/" and len(dimensions) == 1:
        return first if values[0] == first else UNKNOWN
    return NONE if word == "/" and units == {first} != {UNKNOWN} else UNKNOWN
