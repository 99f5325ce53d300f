"""What a kernel returns, and where its numbers stand in it.

Kernels may leave out brackets that hold one thing: a joint of one row may return a number for its
row, an element of one body its pair or block bare. ``entries`` finds for each number the expression
that reaches it.
"""

from typing import Any

from dap3d_core.interface.codegen.instance_layout import shape_of, size


class ShapeError(ValueError):
    """A kernel returned something else than its rows and bodies ask for."""


def entries(value: Any, shape: tuple[int, ...], what: str, name: str = "out") -> list[str]:
    """Expressions for the numbers of ``shape``, by rows, in a kernel's output.

    Args:
        value: a sample of the output: what the kernel returned for some input.
        shape: what is expected; dimensions of extent 1 may be missing in the value.
        what: the expectation in words, for the error.
        name: variable that holds the output in the loop.

    Raises:
        ShapeError: the value has another shape.
    """
    found = checked_shape(value)
    if size(found) != size(shape) or [n for n in found if n > 1] != [n for n in shape if n > 1]:
        raise ShapeError(f"it should return {what}, shape {shape}; it returned shape {found}")
    return _paths(found, name)


def checked_shape(value: Any) -> tuple[int, ...]:
    """Shape of a number or a nested tuple of numbers, whose rows must be of one length."""
    shape = shape_of(value)
    if shape and any(checked_shape(v) != shape[1:] for v in value):
        raise ShapeError("its rows differ in length")
    return shape


def _paths(shape: tuple[int, ...], name: str) -> list[str]:
    if not shape:
        return [name]
    return [path for k in range(shape[0]) for path in _paths(shape[1:], f"{name}[{k}]")]


def value_at(value: Any, path: str) -> Any:
    """The number that an expression of ``entries`` reaches in a value."""
    for index in path.split("[")[1:]:
        value = value[int(index.rstrip("]"))]
    return value
