"""Check of a function: f', f'' and f''', or its partial derivatives, are derivatives."""

import random

import attrs
import numpy as np

from dap3d_core.testing.checks.compare import Comparison, rates
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.random_state import Direction
from dap3d_core.testing.samples.sampled_type import SampledType

#: Arguments of each random function.
ARGUMENTS = 8
_WRONG = (
    "{f} is wrong by {x.error:.3g} at x = {at:.6g}: it is {x.is_:.6g} and should be "
    "{x.should:.6g}, the derivative of {g} ({way})"
)
NAMES = ("f", "f'", "f''", "f'''")
#: Of a function of two arguments: names, and of each argument (derivative, of which).
PARTIALS = ("f", "f_x", "f_y", "f_xx", "f_xy", "f_yy")
PARTIAL = {"x": ((1, 0), (3, 1), (4, 2)), "y": ((2, 0), (4, 1), (5, 2))}
_WRONG_OF_TWO = (
    "{f} is wrong by {x.error:.3g} at x = {at:.6g}, y = {and_at:.6g}: it is {x.is_:.6g} and should "
    "be {x.should:.6g}, the derivative of {g} by {by} ({way})"
)


def derivatives(subject: SampledType) -> CheckOutcome:
    """Each number that ``value`` returns is the derivative of the previous one."""
    if subject.type.arguments > 1:
        return _partial_derivatives(subject)
    what = "f', f'' and f''' against derivatives of f, f' and f''"
    c = Comparison("derivatives", subject, "value", what)
    for k, sample in enumerate(subject.samples):
        rng = random.Random(f"{subject.seed} {k}")
        for _ in range(ARGUMENTS):
            x = rng.uniform(-0.5, 2.5)
            here = attrs.evolve(sample, state=attrs.evolve(sample.state, t=x))
            value = here.value("value")
            if not np.isfinite(value).all():
                continue
            for rate in rates(here, "value", Direction.in_time(), c):
                scale = float(np.max(np.abs([value[1:], rate.value[:3]])))
                for k in (1, 2, 3):
                    words = {"f": NAMES[k], "g": NAMES[k - 1], "at": x, "way": rate.way}
                    bound = None if rate.bound is None else rate.bound[k - 1 : k]
                    c.compare(here, value[k : k + 1], rate.value[k - 1 : k], _WRONG, words=words,
                              tolerance=rate.tolerance, bound=bound, scale=scale,
                              rows=[k])  # fmt: skip
    return c.outcome()


def _partial_derivatives(subject: SampledType) -> CheckOutcome:
    """The same of a function of two arguments; f_xy is the derivative of f_x and that of f_y."""
    what = "partial derivatives against derivatives of f, f_x and f_y"
    c = Comparison("derivatives", subject, "value", what)
    along = {"x": Direction.in_time(), "y": Direction.of_unknown(0, 1)}
    for k, sample in enumerate(subject.samples):
        rng = random.Random(f"{subject.seed} {k}")
        for _ in range(ARGUMENTS):
            x, y = rng.uniform(-0.5, 2.5), rng.uniform(-0.5, 2.5)
            state = attrs.evolve(sample.state, t=x, unknowns=np.array([[y, 0.0]]))
            here = attrs.evolve(sample, state=state)
            value = here.value("value")
            if not np.isfinite(value).all():
                continue
            for by, pairs in PARTIAL.items():
                for rate in rates(here, "value", along[by], c):
                    scale = float(np.max(np.abs([value[1:4], rate.value[:3]])))
                    for k, of in pairs:
                        words = {"f": PARTIALS[k], "g": PARTIALS[of], "at": x, "and_at": y,
                                 "by": by, "way": rate.way}  # fmt: skip
                        bound = None if rate.bound is None else rate.bound[of : of + 1]
                        c.compare(here, value[k : k + 1], rate.value[of : of + 1], _WRONG_OF_TWO,
                                  words=words, tolerance=rate.tolerance, bound=bound, scale=scale,
                                  rows=[k])  # fmt: skip
    return c.outcome()
