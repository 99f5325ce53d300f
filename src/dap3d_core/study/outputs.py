"""What is kept of each run of a study: a quantity, at the end, its extreme, its mean, or all."""

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.registry.spelling import nearest
from dap3d_core.result import Result
from dap3d_core.scene import Mistake, SceneError

Floats = NDArray[np.float64]


def _mean(values: Floats, t: Floats) -> Any:
    """The mean over time, by the trapezoidal rule."""
    span = t[-1] - t[0]
    return np.trapezoid(values, t, axis=-1) / span if span else values[..., -1]


#: What is made of values (..., nt) of a quantity at the reported instants t (nt,).
REDUCTIONS: dict[str, Callable[[Floats, Floats], Any]] = {
    "end": lambda values, t: values[..., -1],
    "min": lambda values, t: np.min(values, axis=-1),
    "max": lambda values, t: np.max(values, axis=-1),
    "mean": _mean,
    "series": lambda values, t: values,
}


@attrs.frozen
class Output:
    """One thing that is kept of each run.

    Attributes:
        name: what it is called: as the user asks for it, ``crank.r.z:max``.
        of: a quantity of one number by its name in results; or a function of the ``Result`` that
            returns one number.
        reduction: one of ``REDUCTIONS``; "" for a function.
    """

    name: str
    of: str | Callable[[Result], Any]
    reduction: str = "end"

    def value(self, result: Result) -> Any:
        """The output of one run: a number, or with "series" (nt,)."""
        if callable(self.of):
            return float(self.of(result))
        return REDUCTIONS[self.reduction](result.quantity(self.of).values, result.t)


def outputs_of(asked: Any) -> tuple[Output, ...]:
    """Outputs as a script asks for them: names, or label -> name or function of the result.

    Raises:
        SceneError: none, one twice, or an unknown reduction.
    """
    if isinstance(asked, str):
        asked = [asked]
    pairs: list[tuple[str, Any]]
    if isinstance(asked, Mapping):
        pairs = list(asked.items())
    else:
        pairs = [(getattr(one, "__name__", one), one) for one in asked]
    mistakes = [] if pairs else [Mistake("outputs", [], "a study needs at least one output")]
    found: list[Output] = []
    for label, one in pairs:
        if callable(one):
            found.append(Output(str(label), one, ""))
            continue
        if not isinstance(one, str):
            mistakes.append(Mistake("outputs", one, "an output is text such as 'crank.r.z:max'"))
            continue
        quantity, colon, reduction = one.rpartition(":")
        if not colon:
            quantity, reduction = one, "end"
        if reduction not in REDUCTIONS:
            what = f"behind the colon stands one of {', '.join(REDUCTIONS)}"
            mistakes.append(Mistake("outputs", one, what, nearest(reduction, REDUCTIONS)))
            continue
        found.append(Output(str(label), quantity, reduction))
    names = [output.name for output in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    mistakes += [Mistake("outputs", name, "an output is named once only") for name in twice]
    if mistakes:
        raise SceneError(mistakes)
    return tuple(found)
