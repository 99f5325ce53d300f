"""An objective as a function of PyTorch, with its gradient."""

from collections.abc import Callable
from typing import Any

from dap3d_core.kernels.array_types import Floats


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
        raise ImportError("to_torch needs PyTorch: pip install 'dap3d[torch]'") from error

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
