"""An objective as a function of JAX, with its gradient."""

from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats


def in_jax(
    objective: Callable[[Floats], float], both: Callable[[Floats], tuple[float, Floats]]
) -> Callable[[Any], Any]:
    """A function of an array (p,) that JAX differentiates once, and calls in traced code.

    Runs are calls of the host; those of ``jax.vmap`` follow one another.

    Args:
        objective, both: the value; value and gradient.

    Raises:
        ImportError: JAX is not installed.
    """
    try:
        import jax
    except ImportError as error:
        raise ImportError("to_jax needs JAX: pip install 'dap3d[jax]'") from error

    def value_at(x: Any) -> Floats:
        return np.asarray(objective(np.asarray(x, dtype=float)), dtype=x.dtype)

    def both_at(x: Any) -> tuple[Floats, Floats]:
        value, gradient = both(np.asarray(x, dtype=float))
        return np.asarray(value, dtype=x.dtype), gradient.astype(x.dtype)

    def number(x: Any) -> Any:
        return jax.ShapeDtypeStruct((), x.dtype)

    @jax.custom_vjp
    def function(x: Any) -> Any:
        return jax.pure_callback(value_at, number(x), x, vmap_method="sequential")

    def forward(x: Any) -> Any:
        shapes = number(x), jax.ShapeDtypeStruct(x.shape, x.dtype)
        return jax.pure_callback(both_at, shapes, x, vmap_method="sequential")

    def backward(gradient: Any, cotangent: Any) -> tuple[Any]:
        return (cotangent * gradient,)

    function.defvjp(forward, backward)
    return lambda x: function(jax.numpy.asarray(x, dtype=float))
