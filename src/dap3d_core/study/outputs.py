"""What is kept of each run of a study: a quantity, at the end, its extreme, its mean, or all."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.registry.suggestions import nearest
from dap3d_core.result import Result
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.scene.errors import shown
from dap3d_core.simulation import SimulationError

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

#: Names that a study's data set gives to something else.
RESERVED = ("point", "time", "status", "note")
FORM = "an output is text such as 'crank.r.z:max', or a function of the result"


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
        """The output of one run: a number, or with "series" (nt,); NaN without an instant.

        Raises:
            SimulationError: a function raises an exception, or does not return a number.
        """
        if callable(self.of):
            return self._returned(self.of, result)
        if not len(result.t):
            return np.empty(0) if self.reduction == "series" else np.nan
        return REDUCTIONS[self.reduction](result.quantity(self.of).values, result.t)

    def _returned(self, function: Callable[[Result], Any], result: Result) -> float:
        try:
            value = function(result)
        except Exception as error:
            words = f"the function of output {self.name!r} raises {type(error).__name__}: {error}"
            raise SimulationError(words) from error
        try:
            return float(value)
        except (TypeError, ValueError) as error:
            words = f"the function of output {self.name!r} should return one number"
            raise SimulationError(f"{words}, not {shown(value)}") from error


def outputs_of(asked: Any) -> tuple[Output, ...]:
    """Outputs as a script asks for them.

    Args:
        asked: the name of a quantity, perhaps with a reduction behind a colon (one of
            ``REDUCTIONS``, "end" where there is none); a function of the ``Result`` that returns
            one number, called by its name; a list of these; or label -> one of these.

    Raises:
        SceneError: none, one twice, an unknown reduction, a label that is no name; all mistakes.
    """
    if isinstance(asked, str) or callable(asked):
        asked = [asked]
    pairs: list[tuple[Any, Any]]
    if isinstance(asked, Mapping):
        pairs = list(asked.items())
    elif isinstance(asked, Iterable):
        pairs = [(_own_name(one), one) for one in asked]
    else:
        raise SceneError([Mistake("outputs", asked, FORM)])
    if not pairs:
        raise SceneError([Mistake("outputs", MISSING, f"a study needs at least one; {FORM}")])
    read = [_output(label, one) for label, one in pairs]
    found = [one for one in read if isinstance(one, Output)]
    mistakes = [one for one in read if isinstance(one, Mistake)]
    names = [output.name for output in found]
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    mistakes += [Mistake("outputs", name, "an output is named once only") for name in twice]
    if mistakes:
        raise SceneError(mistakes)
    return tuple(found)


def _own_name(one: Any) -> Any:
    """What an output is called that has no label."""
    return getattr(one, "__name__", "") if callable(one) else one


def _output(label: Any, one: Any) -> Output | Mistake:
    if not callable(one) and not isinstance(one, str):
        return Mistake("outputs", one, FORM)
    if callable(one) and (not isinstance(label, str) or not label or label == "<lambda>"):
        what = "a function without a name of its own needs a label"
        return Mistake("outputs", MISSING, what, remedy='give {"label": function}')
    if not isinstance(label, str) or not label.strip() or not label.isprintable():
        return Mistake("outputs", label, "the label of an output is text of one line")
    if label in RESERVED:
        return Mistake("outputs", label, "this is the name of a part of every study; take another")
    if callable(one):
        return Output(label, one, "")
    quantity, colon, reduction = one.rpartition(":")
    if not colon or "." in reduction:  # names of bodies may hold a colon
        quantity, reduction = one, "end"
    if reduction in REDUCTIONS and quantity:
        return Output(label, quantity, reduction)
    if not quantity:
        return Mistake("outputs", one, FORM)
    what = f"behind the colon stands one of {', '.join(REDUCTIONS)}"
    near = nearest(reduction, REDUCTIONS)
    return Mistake("outputs", one, what, f"{quantity}:{near}" if near else "")
