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
from dap3d_core.study.parameters import SceneParameter, with_values


@attrs.frozen
class Limits:
    """The least and the greatest value of a parameter that are accepted."""

    low: float = -LARGEST
    high: float = LARGEST

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


#: Those of a number of which nothing is asked.
OPEN = Limits()


def limits_of(
    prepared: PreparedRun, parameters: Sequence[SceneParameter], *, allow_code: bool = False
) -> list[Limits]:
    """Limits of parameters of a scene; none of inertias, checked at the start.

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

    def last(one: SceneParameter, end: float) -> float:
        return _limit(lambda x: are_accepted([one], [x]), float(one.value or 0.0), end)

    limits = [
        OPEN if one.path[-1] == "Jp" else Limits(last(one, -LARGEST), last(one, LARGEST))
        for one in parameters
    ]
    for (a, one), (b, other) in combinations(enumerate(parameters), 2):
        are_near = one.path[:2] == other.path[:2] or "parameters" in (one.table, other.table)
        if not are_near or OPEN in (limits[a], limits[b]):
            continue
        ends = ((x for x, _, words in limits[k].ends if words) for k in (a, b))
        if not all(are_accepted([one, other], corner) for corner in product(*ends)):
            what = f"what {one.name} may be depends on {other.name}"
            raise refusal(what, "leave one of these parameters out")
    return limits


def _limit(accepts: Callable[[float], bool], value: float, end: float) -> float:
    """The last number that is accepted on the way from a value, which is, to an end."""
    inside, outside = value, end
    if value and value * end <= 0.0 and not accepts(0.0):
        outside = 0.0
    elif accepts(end):
        return end
    elif value * end < 0.0:
        inside = 0.0
    sign = -1.0 if min(inside, outside) < 0.0 else 1.0
    # sizes by their places among all of double precision
    a, b, *usual = np.abs([inside, outside, 1.0, SMALLEST_INERTIA]).view(np.int64).tolist()
    step = 1 if b > a else -1
    likely = [a + step, b - step, *(place for x in usual for place in (x, x + step))]
    while abs(b - a) > 1:
        middle = likely.pop(0) if likely else (a + b) // 2
        if min(a, b) < middle < max(a, b):
            is_in = accepts(sign * float(np.int64(middle).view(np.float64)))
            a, b = (middle, b) if is_in else (a, middle)
    return sign * float(np.int64(a).view(np.float64)) + 0.0  # no zero has a sign
