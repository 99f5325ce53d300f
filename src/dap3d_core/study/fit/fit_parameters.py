"""Parameters of a fit: their starts and bounds."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.result.quantities.measured_data import is_number
from dap3d_core.scene import Mistake, SceneError, ValidatedScene
from dap3d_core.study.parameters import SceneParameter, parameters_named

FORMS = "a start, (start, low, high), a Parameter, or None for the number of the scene"


@attrs.frozen
class Parameter:
    """A number of a scene that is fitted.

    Attributes:
        start: where the search begins; None: the value in the scene.
        low, high: its bounds.
        scale: a change of it that matters; by default the size of ``start``, and where that is 0
            a tenth of the span between the bounds, or 1.
    """

    start: float | None = None
    low: float = -np.inf
    high: float = np.inf
    scale: float | None = None

    @property
    def size(self) -> float:
        """The scale, given or by default."""
        if self.scale is not None:
            return self.scale
        if self.start:
            return abs(self.start)
        span = self.high - self.low
        return span / 10.0 if np.isfinite(span) and span > 0.0 else 1.0


def read_parameters(
    checked: ValidatedScene, given: Any
) -> tuple[dict[str, Parameter], list[Mistake]]:
    """Parameters as ``fit`` takes them, by name, with their starts; and mistakes."""
    if isinstance(given, str):
        given = [given]
    try:
        values: dict[Any, Any] = dict(given) if isinstance(given, Mapping) else dict.fromkeys(given)
    except TypeError:
        what = "parameters are {'forces.spring.k': (start, low, high)}, or names alone"
        return {}, [Mistake("parameters", given, what)]
    if not values:
        return {}, [Mistake("parameters", [], "a fit needs at least one parameter")]
    mistakes: list[Mistake] = []
    known: tuple[SceneParameter, ...] = ()
    try:
        known = parameters_named(checked, list(values), "parameters")
    except SceneError as error:
        mistakes += error.mistakes
    starts = {parameter.name: parameter.value for parameter in known}
    parameters = {n: _parameter(n, value, starts, mistakes) for n, value in values.items()}
    what = "this is a setting of the run, not a number of the mechanism"
    mistakes += [Mistake("parameters", p.name, what) for p in known if p.table == "simulation"]
    return parameters, mistakes


def _parameter(
    name: Any, value: Any, starts: Mapping[Any, float | None], mistakes: list[Mistake]
) -> Parameter:
    """One checked parameter."""
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
    start = starts.get(name) if start is None else start
    if start is None:
        if name in starts:
            what = "the scene leaves this number open: it needs a start"
            mistakes.append(Mistake(key, None, what))
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
