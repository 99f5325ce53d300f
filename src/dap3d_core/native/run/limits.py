"""Limits of a parameter of an exported model: what the checks of a scene accept, found by trial.

Fields, bodies, materials and ``prepare`` of types each have checks; an exported model has their
outcome: a least and a greatest value.
"""

from collections.abc import Callable, Sequence
from itertools import combinations, product

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS
from dap3d_core.interface.errors import PluginError
from dap3d_core.model import ModelError, build_model
from dap3d_core.native.run.prepared import PreparedRun, refusal
from dap3d_core.scene import SceneError
from dap3d_core.scene.validate.coerce_values import LARGEST
from dap3d_core.scene.validate.validate import check
from dap3d_core.study.parameters import SceneParameter, with_values


@attrs.frozen
class Limits:
    """The least and the greatest value of a parameter that are accepted."""

    low: float = -LARGEST
    high: float = LARGEST

    @property
    def is_open(self) -> bool:
        """True if every number is accepted."""
        return self == OPEN

    @property
    def ends(self) -> tuple[tuple[float, str], tuple[float, str]]:
        """Both, each with what is said of a number beyond it; "" of the largest numbers."""
        low, high = self.closed
        least = "greater than" if low != self.low else "at least"
        most = "less than" if high != self.high else "at most"
        return (
            (self.low, "" if low is None else f"should be {least} {_text(low)}"),
            (self.high, "" if high is None else f"should be {most} {_text(high)}"),
        )

    @property
    def closed(self) -> tuple[float | None, float | None]:
        """Both, or the round number next to them, which is not accepted; None for no limit."""
        low, high = np.nextafter(self.low, -np.inf), np.nextafter(self.high, np.inf)
        return (
            None if self.low == -LARGEST else _rounder(self.low, float(low)),
            None if self.high == LARGEST else _rounder(self.high, float(high)),
        )


#: Those of a number of which nothing is asked.
OPEN = Limits()


def _text(number: float) -> str:
    """A number in as few digits as it has."""
    return f"{number:g}" if float(f"{number:g}") == number else repr(number)


def _rounder(number: float, other: float) -> float:
    """The one of two numbers that has fewer digits."""
    return min(number, other, key=lambda x: len(repr(x)))


def limits_of(
    prepared: PreparedRun, parameters: Sequence[SceneParameter], *, allow_code: bool = False
) -> list[Limits]:
    """Limits of parameters of a scene; none of several inertias of a body, checked at the start.

    Raises:
        SceneError: what is accepted of one parameter depends on another: their names.
    """

    @IGNORE_FLOAT_ERRORS
    def are_accepted(chosen: Sequence[SceneParameter], values: Sequence[float]) -> bool:
        scene = with_values(prepared.compiled.scene, chosen, values)
        try:
            build_model(check(scene, prepared.compiled.checked.registry, allow_code=allow_code))
        except (SceneError, ModelError, PluginError):
            return False
        return True

    found = []
    for one in parameters:
        value = float(one.value or 0.0)
        found.append(Limits(*(
            _limit(lambda x, one=one: are_accepted([one], [x]), value, end)  # type: ignore[misc]
            for end in (-LARGEST, LARGEST)
        )))  # fmt: skip
    limits = list(found)
    for (a, one), (b, other) in combinations(enumerate(parameters), 2):
        are_near = one.path[:2] == other.path[:2] or "parameters" in (one.table, other.table)
        if not are_near or limits[a].is_open or limits[b].is_open:
            continue
        if one.path == other.path and one.path[-1] == "Jp":
            found[a] = found[b] = OPEN
            continue
        ends = ((x for x, words in limits[k].ends if words) for k in (a, b))
        if not all(are_accepted([one, other], corner) for corner in product(*ends)):
            what = f"what {one.name} may be depends on {other.name}"
            raise refusal(what, "leave one of these parameters out")
    return found


def _limit(accepts: Callable[[float], bool], value: float, end: float) -> float:
    """The last number that is accepted on the way from a value, which is, to an end."""
    inside, outside = value, end
    if value and value * end <= 0.0 and not accepts(0.0):
        outside = 0.0
    elif accepts(end):
        return end
    elif value * end < 0.0:
        inside = 0.0
    a, b, one, minus_one = map(_ordinal, (inside, outside, 1.0, -1.0))
    step = 1 if b > a else -1
    likely = [a + step, b - step, one, one + step, minus_one, minus_one + step]
    while abs(b - a) > 1:
        middle = likely.pop(0) if likely else (a + b) // 2
        if min(a, b) < middle < max(a, b):
            a, b = (middle, b) if accepts(_number(middle)) else (a, middle)
    return _number(a)


def _ordinal(number: float) -> int:
    """The place of a number among all of double precision; 0 of zero."""
    bits = int(np.float64(abs(number)).view(np.int64))
    return bits if number >= 0.0 else -bits


def _number(ordinal: int) -> float:
    """The number at a place."""
    size = float(np.int64(abs(ordinal)).view(np.float64))
    return size if ordinal >= 0 else -size
