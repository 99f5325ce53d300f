"""Check of a function: f', f'' and f''' are derivatives."""

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


def derivatives(subject: SampledType) -> CheckOutcome:
    """Each number that ``value`` returns is the derivative of the previous one."""
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
