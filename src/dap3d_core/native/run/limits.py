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
from dap3d_core.scene.validate.bodies import SMALLEST_INERTIA
from dap3d_core.scene.validate.coerce_values import LARGEST
from dap3d_core.scene.validate.validate import check
from dap3d_core.study.parameters import SceneParameter, all_parameters, with_values

#: Tables whose numbers belong together: contacts have those of their materials.
MATERIALS = {"materials", "contacts"}


@attrs.frozen
class Limits:
    """The least and the greatest value of a parameter that are accepted.

    Attributes:
        low, high: those, whatever other parameters of the export are.
        under: another of them, which it has to be at most, or less than; "" for none.
        is_open: it has to be less.
    """

    low: float = -LARGEST
    high: float = LARGEST
    under: str = ""
    is_open: bool = False

    @property
    def ends(self) -> list[tuple[float, float | None, str]]:
        """Of both: itself, the round number there (None, no limit), what is said beyond it."""
        found: list[tuple[float, float | None, str]] = []
        kinds = (self.low, -LARGEST, "at least", "greater than"), (
            self.high, LARGEST, "at most", "less than")  # fmt: skip
        for last, end, closed, open_ in kinds:
            at = min(last, float(np.nextafter(last, end)), key=lambda x: len(repr(x)))
            words = f"should be {closed if at == last else open_} {repr(at).removesuffix('.0')}"
            found.append((last, None, "") if last == end else (last, at, words))
        return found

    @property
    def words(self) -> list[str]:
        """All that is said of values beyond them."""
        found = [said for *_, said in self.ends if said]
        return found + ([f"should be {self.under_words} {self.under}"] if self.under else [])

    @property
    def under_words(self) -> str:
        """How it compares to the parameter that it is under."""
        return "less than" if self.is_open else "at most"


#: Those of a number of which nothing is asked.
OPEN = Limits()


class _Trials:
    """Which values of parameters the checks of a scene accept."""

    def __init__(self, prepared: PreparedRun, *, allow_code: bool) -> None:
        checked = prepared.compiled.checked
        self._scene, self._registry = prepared.compiled.scene, checked.registry
        self._allow_code = allow_code
        #: Table and owner -> its numbers, of which one may be the limit of another.
        self._numbers: dict[tuple[str, ...], list[float]] = {}
        for one in all_parameters(checked):
            self._numbers.setdefault(one.path[:2], []).append(float(one.value or 0.0))

    @IGNORE_FLOAT_ERRORS
    def accept(self, values: Sequence[tuple[SceneParameter, float]]) -> bool:
        """True if they accept the scene with these values."""
        chosen, numbers = zip(*values, strict=True)
        scene = with_values(self._scene, chosen, numbers)
        try:
            build_model(check(scene, self._registry, allow_code=self._allow_code))
        except (SceneError, ModelError, PluginError):
            return False
        return True

    def last(self, one: SceneParameter, end: float, *others: tuple[SceneParameter, float]) -> float:
        """The last value that is accepted on the way to an end, with values of others."""
        likely = [x for x in self._numbers.get(one.path[:2], ()) if x * end > 0.0]
        return _limit(lambda x: self.accept([(one, x), *others]), one.value or 0.0, end, likely)


def limits_of(
    prepared: PreparedRun, parameters: Sequence[SceneParameter], *, allow_code: bool = False
) -> list[Limits]:
    """Limits of parameters of a scene; none of inertias, checked at the start.

    Raises:
        SceneError: what is accepted of one parameter depends on another, and it is not that one
            has to be under the other: their names.
    """
    trials = _Trials(prepared, allow_code=allow_code)
    limits = [
        OPEN if one.path[-1] == "Jp" else
        Limits(trials.last(one, -LARGEST), trials.last(one, LARGEST))
        for one in parameters
    ]  # fmt: skip
    in_order: set[int] = set()
    for (a, one), (b, other) in combinations(enumerate(parameters), 2):
        if not _are_near(one, other) or OPEN in (limits[a], limits[b]):
            continue
        ends = ((x for x, _, words in limits[k].ends if words) for k in (a, b))
        if all(trials.accept([(one, x), (other, y)]) for x, y in product(*ends)):
            continue
        for k, n in ((a, b), (b, a)):
            found = _ordered(trials, (parameters[k], parameters[n]), (limits[k], limits[n]))
            if found and not in_order & {a, b}:
                limits[k], limits[n] = found
                in_order |= {a, b}
                break
        else:
            what = f"what {one.name} may be depends on {other.name}"
            raise refusal(what, "leave one of these parameters out")
    return limits


def _are_near(one: SceneParameter, other: SceneParameter) -> bool:
    """True if what one may be can depend on the other."""
    tables = {one.table, other.table}
    return one.path[:2] == other.path[:2] or "parameters" in tables or tables <= MATERIALS


def _ordered(
    trials: _Trials, pair: tuple[SceneParameter, SceneParameter], limits: tuple[Limits, Limits]
) -> tuple[Limits, Limits] | None:
    """Limits of two parameters of which one has to be under the other; None if that is not it."""
    (lower, upper), (below, above) = pair, limits
    high = trials.last(lower, LARGEST, (upper, above.high))
    low = trials.last(upper, -LARGEST, (lower, below.low))
    found = set()
    for x in (max(below.low, low), lower.value or 0.0, upper.value or 0.0):
        if x < min(high, above.high):
            y = float(np.nextafter(x, LARGEST))
            pairs = (x, x), (y, x), (x, y)
            found.add(tuple(trials.accept([(lower, a), (upper, b)]) for a, b in pairs))
    if len(found) != 1 or (order := found.pop())[1:] != (False, True):
        return None
    is_open = not order[0]
    ends = (high, LARGEST), (low, -LARGEST)
    high, low = (end if x == np.nextafter(end, 0.0) else x for x, end in ends)
    return Limits(below.low, high, upper.name, is_open), Limits(low, above.high)


def _limit(
    accepts: Callable[[float], bool], value: float, end: float, likely: Sequence[float] = ()
) -> float:
    """The last number that is accepted on the way from a value, which is, to an end.

    likely: numbers that may be it.
    """
    inside, outside = value, end
    if value and value * end <= 0.0 and not accepts(0.0):
        outside = 0.0
    elif accepts(end):
        return end
    elif value * end < 0.0:
        inside = 0.0
    sign = -1.0 if min(inside, outside) < 0.0 else 1.0
    # sizes by their places among all of double precision
    a, b, *usual = np.abs([inside, outside, 1.0, SMALLEST_INERTIA, *likely]).view(np.int64).tolist()
    step = 1 if b > a else -1
    places = [a + step, b - step, *(place for x in usual for place in (x, x + step, x - step))]
    while abs(b - a) > 1:
        middle = places.pop(0) if places else (a + b) // 2
        if min(a, b) < middle < max(a, b):
            is_in = accepts(sign * float(np.int64(middle).view(np.float64)))
            a, b = (middle, b) if is_in else (a, middle)
    return sign * float(np.int64(a).view(np.float64)) + 0.0  # no zero has a sign
