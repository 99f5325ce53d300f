"""Checks of contacts: their normal, and a law of friction of their own."""

import attrs
import numpy as np

from dap3d_core.testing.checks.compare import Comparison
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.sampled_type import SampledType

#: Part of its speed at which slip is next to nothing, and tolerance of coefficients there.
SLOW, CONTINUOUS = 1e-9, 1e-6
_DRIVES = "grip gives {x.is_:.3g}: a negative coefficient of friction would drive"
_NONE = "grip gives none along the grain, and {x.is_:.3g} across it; take a small one"
_JUMPS = (
    "grip jumps where slip begins: it gives {x.is_:.6g} at next to no speed and {x.should:.6g} at "
    "none"
)
_LONG = "the normal is {x.is_:.6g} long; of another length than 1 forces, slip and gaps differ"


def normal(subject: SampledType) -> CheckOutcome:
    """The normal, or the axis of a moment, is a unit vector: J has it where the gap is."""
    c = Comparison("normal", subject, "normal", "the normal is a unit vector")
    part = slice(0, 3) if subject.type.at is not None else slice(3, 6)
    for sample in subject.samples:
        c.compare(sample, np.linalg.norm(sample.value("J")[0, :1, part], axis=1), 1.0, _LONG)
    return c.outcome()


def grip(subject: SampledType) -> CheckOutcome:
    """Coefficients of friction are not negative, and continuous where slip begins."""
    c = Comparison("grip", subject, "grip", "coefficients are not negative; those of slow slip")
    for sample in subject.samples:
        mu = sample.value("tension")[-4:]
        slow = attrs.evolve(sample.state, v=SLOW * sample.state.v, w=SLOW * sample.state.w)
        near = sample.value("tension", slow)[-4:]
        c.compare(sample, np.minimum(mu, 0.0), 0.0, _DRIVES)
        c.compare(sample, np.where(mu[::2] == 0.0, mu[1::2], 0.0), 0.0, _NONE)
        c.compare(sample, near[:2], near[2:], _JUMPS, tolerance=CONTINUOUS)
    return c.outcome()
