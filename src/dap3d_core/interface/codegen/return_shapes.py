"""Shapes of the return values of kernels.

Kernels may omit brackets around a single entry: a joint of one row may return a number for its row,
an element of one body its pair or block. ``entries`` gives the expression of each number.
"""

from collections.abc import Sequence
from typing import Any

from dap3d_core.interface.codegen.instance_layout import shape_of, size


class ShapeError(ValueError):
    """The return value of a kernel does not match its rows and bodies."""


def entries(value: Any, shape: tuple[int, ...], what: str, name: str = "out") -> list[str]:
    """Expressions for the numbers of ``shape``, by rows, in a kernel's output.

    Args:
        value: a sample of the output.
        shape: the expected shape; dimensions of extent 1 may be missing in the value.
        what: the expectation, for the error.
        name: variable of the output in the loop.

    Raises:
        ShapeError: the value has another shape.
    """
    actual = checked_shape(value)
    if size(actual) != size(shape) or [n for n in actual if n > 1] != [n for n in shape if n > 1]:
        raise ShapeError(f"it should return {what}, shape {shape}; it returned shape {actual}")
    return _paths(actual, name)


def state_entries(value: Any, shapes: Sequence[tuple[int, ...]]) -> list[str]:
    """As ``entries``, of what ``rate`` returns: the derivative of each state, in their order.

    Raises:
        ShapeError: the value has another shape.
    """
    what = f"{sum(map(size, shapes))} numbers, the derivatives of its states"
    if len(shapes) == 1:
        return entries(value, shapes[0], what)
    count = len(value) if isinstance(value, (tuple, list)) else 1
    if count != len(shapes):
        raise ShapeError(
            f"it should return {len(shapes)} derivatives, one for each state; it returned {count}"
        )
    parts = zip(value, shapes, strict=True)
    found = [entries(part, shape, what, f"out[{k}]") for k, (part, shape) in enumerate(parts)]
    return [path for paths in found for path in paths]


def checked_shape(value: Any) -> tuple[int, ...]:
    """Shape of a number or a nested tuple of numbers, with rows of equal length."""
    shape = shape_of(value)
    if shape and any(checked_shape(v) != shape[1:] for v in value):
        raise ShapeError("its rows differ in length")
    return shape


def _paths(shape: tuple[int, ...], name: str) -> list[str]:
    if not shape:
        return [name]
    return [path for k in range(shape[0]) for path in _paths(shape[1:], f"{name}[{k}]")]


def value_at(value: Any, path: str) -> Any:
    """The number of an expression of ``entries`` in a value."""
    for index in path.split("[")[1:]:
        value = value[int(index.rstrip("]"))]
    return value
