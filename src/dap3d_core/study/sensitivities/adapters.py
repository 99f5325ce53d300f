"""An objective as a function of JAX, or of PyTorch, with its gradient."""

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
        raise ImportError("to_jax needs JAX: pip install jax") from error

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


def in_torch(
    objective: Callable[[Floats], float], both: Callable[[Floats], tuple[float, Floats]]
) -> Callable[[Any], Any]:
    """A function of a tensor (p,) that PyTorch differentiates once.

    Args:
        objective, both: the value; value and gradient.

    Raises:
        ImportError: PyTorch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise ImportError("to_torch needs PyTorch: pip install torch") from error

    class Run(torch.autograd.Function):  # type: ignore[misc]
        """A run; its gradient is computed with it, where it will be asked for."""

        @staticmethod
        def forward(ctx: Any, x: Any) -> Any:
            point = x.detach().cpu().double().numpy()
            if not x.requires_grad:
                return x.new_tensor(objective(point))
            value, gradient = both(point)
            ctx.save_for_backward(x.new_tensor(gradient))
            return x.new_tensor(value)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, cotangent: Any) -> Any:
            return cotangent * ctx.saved_tensors[0]

    return lambda x: Run.apply(x)
