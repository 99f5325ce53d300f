"""Check of a function: f', f'' and f''' are derivatives."""

import random
from collections.abc import Callable

import attrs
import numpy as np

from dap3d_core.testing.checks.compare import Comparison, Wrong, rates
from dap3d_core.testing.checks.findings import Outcome
from dap3d_core.testing.samples.random_state import Direction
from dap3d_core.testing.samples.sampled_type import SampledType

#: Arguments of each random function.
ARGUMENTS = 8
NAMES = ("f", "f'", "f''", "f'''")


def derivatives(subject: SampledType) -> Outcome:
    """Each number that ``value`` returns is the derivative of the previous one."""
    words = "f', f'' and f''' against derivatives of f, f' and f''"
    c = Comparison("derivatives", subject, "value", words)
    for k, sample in enumerate(subject.samples):
        rng = random.Random(f"{subject.seed} {k}")
        for _ in range(ARGUMENTS):
            x = rng.uniform(-0.5, 2.5)
            here = attrs.evolve(sample, state=attrs.evolve(sample.state, t=x))
            value = here.value("value")
            if not np.isfinite(value).all():
                continue
            for rate in rates(here, "value", Direction.in_time(), c):
                c.compare(here, value[1:], rate.value[:3], _about(x, rate.way), rows=(1, 2, 3),
                          tolerance=rate.tolerance,
                          bound=None if rate.bound is None else rate.bound[:3])  # fmt: skip
    return c.outcome()


def _about(x: float, way: str) -> Callable[[Wrong], str]:
    return lambda wrong: (
        f"{NAMES[wrong.row]} is wrong by {wrong.error:.3g} at x = {x:.6g}: it is {wrong.is_:.6g} "
        f"and should be {wrong.should:.6g}, the derivative of {NAMES[wrong.row - 1]} ({way})"
    )
