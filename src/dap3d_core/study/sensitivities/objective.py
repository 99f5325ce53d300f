"""Public function ``objective``: a number of a run as a function of parameters, with its gradient.

f = dap.objective(scene, by=["forces.spring.k"], of="mass.r.x:max")
scipy.optimize.minimize(f.value_and_gradient, f.x0, jac=True)
"""

import inspect
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.suggestions import did_you_mean, nearest
from dap3d_core.result import Result, ResultError, UnknownNameError, find
from dap3d_core.scene import Mistake, Scene, SceneError
from dap3d_core.simulation import CompiledModel, simulate
from dap3d_core.simulation.output.check_outputs import probe_of
from dap3d_core.study.outputs import REDUCTIONS, unknown_quantity
from dap3d_core.study.parameters import with_values
from dap3d_core.study.sensitivities.sensitivities import parameters_by, sensitivities, take_varied

#: Arguments of ``sensitivities`` that are no settings.
OWN = ("scene", "by", "allow_code", "announce")
#: Name of the output that an expression becomes.
NAME = "objective"
#: Numbers of a quantity over a run, by their names.
NUMBERS = {name: number for name, number in REDUCTIONS.items() if name != "series"}


class Objective:
    """A number of a run as a function of p parameters.

    Attributes:
        names: of the parameters.
        x0: (p,) their values in the scene.
        runs, gradients: how often the scene was run, and with derivatives.
    """

    def __init__(
        self, scene: Scene, by: Sequence[str], of: str, settings: dict[str, Any], allow_code: bool
    ) -> None:
        """Args: as of ``objective``.

        Raises:
            SceneError: an unknown parameter or quantity, with the nearest.
        """
        self._scene, self._settings = scene.copy(), settings
        take_varied(self._scene, by, settings)
        quantity, colon, number = of.rpartition(":")
        quantity, number = (quantity, number.strip()) if colon else (of, "final")
        if number not in NUMBERS:
            what = f"the number after the colon is one of {', '.join(NUMBERS)}"
            near = nearest(number, NUMBERS)
            raise SceneError([Mistake("of", of, what, f"{quantity}:{near}" if near else "")])
        self._number = NUMBERS[number]
        self._quantity = self._named(quantity.strip(), of, allow_code)
        compiled = self._compiled(self._scene, allow_code)
        self._registry = compiled.checked.registry
        self._parameters = parameters_by(compiled.checked, by)
        self.names = tuple(by)
        self.x0 = np.array([float(p.value or 0.0) for p in self._parameters])
        self.runs = self.gradients = 0

    def __repr__(self) -> str:
        return f"<Objective by {', '.join(self.names)} of {self._scene!r}>"

    def __call__(self, x: ArrayLike) -> float:
        """The value at a point x (p,). Errors as of ``simulate``."""
        self.runs += 1
        model = self._compiled(self._at(x))
        return float(self._of(simulate(model, **self._settings)))

    def gradient(self, x: ArrayLike) -> Floats:
        """The gradient (p,) at a point x (p,). Errors as of ``sensitivities``."""
        return self.value_and_gradient(x)[1]

    def value_and_gradient(self, x: ArrayLike) -> tuple[float, Floats]:
        """Value and gradient at a point x (p,), of one run. Errors as of ``sensitivities``."""
        self.gradients += 1
        found = sensitivities(self._compiled(self._at(x)), self.names, **self._settings)
        gradient = found.of_number(self._quantity, self._number)
        return float(self._of(found.result)), gradient

    def to_jax(self) -> Callable[[Any], Any]:
        """A function of JAX, for ``jax.grad`` and ``jax.jit`` (extra ``jax``).

        It takes an array (p,) and returns a number of JAX's floating-point type: switch
        ``jax_enable_x64`` on for double precision.

        Raises:
            ImportError: JAX is not installed.
        """
        return _in_jax(self, self.value_and_gradient)

    def to_torch(self) -> Callable[[Any], Any]:
        """A function of PyTorch, of a tensor (p,), with its gradient (extra ``torch``).

        Raises:
            ImportError: PyTorch is not installed.
        """
        return _in_torch(self, self.value_and_gradient)

    def _of(self, result: Result) -> Any:
        return self._number(result.quantity(self._quantity).values, result.t)

    def _at(self, x: ArrayLike) -> Scene:
        values = np.asarray(x, dtype=float).reshape(-1)
        if len(values) != len(self.names):
            raise ValueError(f"x has {len(values)} numbers for {len(self.names)} parameters")
        return with_values(self._scene, self._parameters, values.tolist())

    def _compiled(self, scene: Scene, allow_code: bool = False) -> CompiledModel:
        registry = getattr(self, "_registry", None)
        method = self._settings.get("method")
        return CompiledModel(scene, method=method, registry=registry, allow_code=allow_code)

    def _named(self, quantity: str, of: str, allow_code: bool) -> str:
        """The name of the quantity; of an expression that of an output that it becomes."""
        compiled = self._compiled(self._scene, allow_code)
        probe = probe_of(compiled.scene_text, compiled.evaluator)
        try:
            found = find(probe, quantity)
        except (UnknownNameError, ResultError) as error:
            if not any(sign in quantity for sign in "+-*/( "):
                raise SceneError([unknown_quantity("of", of, error)]) from None
            name = NAME
            while name in self._scene.outputs:
                name += "_"
            self._scene.outputs[name] = quantity
            compiled = self._compiled(self._scene, allow_code)
            if find(probe_of(compiled.scene_text, compiled.evaluator), name).components:
                what = "this is a vector; take its norm, or a component of what it is made of"
                raise SceneError([Mistake("of", of, what)]) from None
            return name
        if found.components:
            what = "this is a vector; name a component"
            raise SceneError([Mistake("of", of, what, found.columns[0])])
        return quantity


@checked
def objective(
    scene: Scene | str | os.PathLike[str],
    by: Sequence[str] | str,
    of: str,
    *,
    allow_code: bool = False,
    **settings: Any,
) -> Objective:
    """A number of a run as a function of parameters, for optimisation with exact gradients.

    Args:
        scene: a Scene, or what ``load`` takes.
        by: names of parameters, as of ``sensitivities``.
        of: ``QUANTITY:NUMBER``: a quantity, or an expression of quantities as in ``[outputs]``;
            and "final" (without a colon as well), "mean", "rms", "max", "min" or "integral" over
            time.
        settings: as of ``sensitivities``.

    Raises:
        SceneError: mistakes of the scene; an unknown parameter or quantity, with the nearest.
    """
    from dap3d_core.scene import load

    own = scene if isinstance(scene, Scene) else load(scene)
    names = [by] if isinstance(by, str) else list(by)
    known = [name for name in inspect.signature(sensitivities).parameters if name not in OWN]
    for name in settings:
        if name not in known:
            hint = did_you_mean(name, known, "{} ")
            raise TypeError(f"objective takes no {name}; {hint}settings: {', '.join(known)}")
    return Objective(own, names, of, settings, allow_code)


def _in_jax(
    objective: Callable[[Floats], float], both: Callable[[Floats], tuple[float, Floats]]
) -> Callable[[Any], Any]:
    """A function of an array (p,) that JAX differentiates once, and calls in traced code.

    Runs are calls of the host; those of ``jax.vmap`` follow one another.

    Args:
        objective, both: the value; value and gradient.
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


def _in_torch(
    objective: Callable[[Floats], float], both: Callable[[Floats], tuple[float, Floats]]
) -> Callable[[Any], Any]:
    """A function of a tensor (p,) that PyTorch differentiates once.

    Args:
        objective, both: the value; value and gradient.
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
