"""Limits of a parameter of an exported model: what the checks of a scene accept, found by trial.

Fields, bodies, materials and ``prepare`` of types each have checks; an exported model has their
outcome: a least and a greatest value.
"""

from collections.abc import Callable, Sequence
from itertools import combinations, product
from typing import Any

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
#: Part of the largest number by which one less is that as well.
ROUNDED = 1e-12


@attrs.frozen
class Limits:
    """The least and the greatest value of a parameter that are accepted.

    Attributes:
        low, high: those, whatever other parameters of the export are.
        under: others of them, which it has to be at most; or less than, where True is beside.
    """

    low: float = -LARGEST
    high: float = LARGEST
    under: tuple[tuple[str, bool], ...] = ()

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
        return found + [
            f"should be {'less than' if is_open else 'at most'} {name}"
            for name, is_open in self.under
        ]


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
        self._known: dict[tuple[Any, ...], float] = {}

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
        key = one.name, end, *((other.name, x) for other, x in others)
        if key not in self._known:
            likely = [x for x in self._numbers.get(one.path[:2], ()) if x * end > 0.0]
            self._known[key] = _limit(
                lambda x: self.accept([(one, x), *others]), one.value or 0.0, end, likely
            )
        return self._known[key]


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
    orders: dict[tuple[int, int], bool] = {}
    for (a, one), (b, other) in combinations(enumerate(parameters), 2):
        if not _are_near(one, other) or OPEN in (limits[a], limits[b]):
            continue
        ends = ((x for x, _, words in limits[k].ends if words) for k in (a, b))
        if all(trials.accept([(one, x), (other, y)]) for x, y in product(*ends)):
            continue
        for k, n in ((a, b), (b, a)):
            found = _order(trials, (parameters[k], parameters[n]), (limits[k], limits[n]))
            if found is not None:
                orders[k, n] = found
                break
        else:
            what = f"what {one.name} may be depends on {other.name}"
            raise refusal(what, "leave one of these parameters out")
    return _ordered(trials, parameters, limits, orders)


def _ordered(
    trials: _Trials, parameters: Sequence[SceneParameter], limits: Sequence[Limits],
    orders: dict[tuple[int, int], bool],
) -> list[Limits]:  # fmt: skip
    """Limits of parameters whatever those are that they have to be under, or over.

    orders: (lower, upper) -> it has to be less.
    """

    def beyond(k: int, *, up: bool) -> list[int]:
        pairs = orders if up else [(b, a) for a, b in orders]
        found = [n for m, n in pairs if m == k]
        return list(dict.fromkeys([*found, *(x for n in found for x in beyond(n, up=up))]))

    def end(k: int, *, up: bool) -> float:
        others = [(parameters[n], end(n, up=up)) for n in beyond(k, up=up)]
        if not others:
            return limits[k].high if up else limits[k].low
        return trials.last(parameters[k], LARGEST if up else -LARGEST, *others)

    def limit(k: int, *, up: bool) -> float:
        x = end(k, up=up)  # a little less where it is less than another
        return float(np.copysign(LARGEST, x)) if abs(x) > (1.0 - ROUNDED) * LARGEST else x

    under = [
        tuple((parameters[n].name, is_open) for (m, n), is_open in orders.items() if m == k)
        for k in range(len(parameters))
    ]
    ends = [(limit(k, up=False), limit(k, up=True)) for k in range(len(parameters))]
    return [Limits(*both, names) for both, names in zip(ends, under, strict=True)]


def _are_near(one: SceneParameter, other: SceneParameter) -> bool:
    """True if what one may be can depend on the other."""
    tables = {one.table, other.table}
    return one.path[:2] == other.path[:2] or "parameters" in tables or tables <= MATERIALS


def _order(
    trials: _Trials, pair: tuple[SceneParameter, SceneParameter], limits: tuple[Limits, Limits]
) -> bool | None:
    """Whether one parameter has to be less than another (True), or at most; None if neither."""
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
    return not order[0]


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
