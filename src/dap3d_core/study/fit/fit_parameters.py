"""Parameters of a fit: where they start, and the bounds that they keep."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.scene import Checked, Mistake, SceneError
from dap3d_core.study.parameters import Number, numbers_named

#: What a parameter may be given as.
FORMS = "a start, (start, low, high), a Parameter, or None for the number of the scene"


@attrs.frozen
class Parameter:
    """A number of a scene that is to be found.

    Attributes:
        start: where the search begins; None: what stands in the scene.
        low, high: it stays from ``low`` to ``high``.
        scale: a change of it that matters; by default the size of ``start``, and where that is 0
            a tenth of the span between the bounds, or 1.
    """

    start: float | None = None
    low: float = -np.inf
    high: float = np.inf
    scale: float | None = None

    @property
    def size(self) -> float:
        """The scale, given or found."""
        if self.scale is not None:
            return self.scale
        if self.start:
            return abs(self.start)
        span = self.high - self.low
        return span / 10.0 if np.isfinite(span) and span > 0.0 else 1.0


def read_parameters(
    checked: Checked, asked: Any
) -> tuple[tuple[Number, ...], list[Parameter], list[Mistake]]:
    """Parameters as ``fit`` takes them: numbers of the scene, what is known, what is wrong."""
    if isinstance(asked, str):
        asked = [asked]
    try:
        given: dict[Any, Any] = dict(asked) if isinstance(asked, Mapping) else dict.fromkeys(asked)
    except TypeError:
        what = "parameters are {'forces.spring.k': (start, low, high)}, or names alone"
        return (), [], [Mistake("parameters", asked, what)]
    if not given:
        return (), [], [Mistake("parameters", [], "a fit needs at least one parameter")]
    mistakes: list[Mistake] = []
    numbers: tuple[Number, ...] = ()
    try:
        numbers = numbers_named(checked, list(given))
    except SceneError as error:
        mistakes += [attrs.evolve(m, key="parameters") for m in error.mistakes]
    starts = {number.name: number.value for number in numbers}
    found = [_parameter(name, value, starts, mistakes) for name, value in given.items()]
    for number in numbers:
        if number.table == "simulation":
            what = "this is a setting of the run, not a number of the mechanism"
            mistakes.append(Mistake("parameters", number.name, what))
    return numbers, found, mistakes


def _parameter(
    name: Any, value: Any, starts: Mapping[Any, float | None], mistakes: list[Mistake]
) -> Parameter:
    """One of them; checked, and with its start."""
    key = f"parameters.{name}"
    start, low, high, scale = value, None, None, None
    if isinstance(value, Parameter):
        start, low, high, scale = value.start, value.low, value.high, value.scale
    elif isinstance(value, (tuple, list)):
        if len(value) != 3:
            mistakes.append(Mistake(key, value, f"should be {FORMS}"))
            return Parameter(1.0)
        start, low, high = value
    low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
    if any(not is_number(v) for v in (start, low, high, scale) if v is not None):
        mistakes.append(Mistake(key, value, f"should be numbers: {FORMS}"))
        return Parameter(1.0)
    if start is None:
        start = starts.get(name)
        if start is None and name in starts:
            what = "the scene leaves this number open: it needs a start"
            mistakes.append(Mistake(key, None, what))
        if start is None:
            return Parameter(1.0)
    if not np.isfinite(start):
        mistakes.append(Mistake(key, float(start), "a start is finite"))
    elif not low < high:
        mistakes.append(Mistake(key, value, f"its lower bound {low:g} is not below {high:g}"))
    elif not low <= start <= high:
        what = f"the start lies outside of its bounds, {low:g} to {high:g}"
        mistakes.append(Mistake(key, float(start), what))
    if scale is not None and not (scale > 0.0 and np.isfinite(scale)):
        mistakes.append(Mistake(key, float(scale), "a scale is above 0"))
        scale = None
    return Parameter(float(start), float(low), float(high), scale)


def is_number(value: Any) -> bool:
    """Whether something is one number, and no truth value."""
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
