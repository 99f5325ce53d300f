"""Checks of an element with states of its own: its rates, and what reads the states."""

import attrs
import numpy as np

from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.testing.checks.compare import Comparison, body_words, rates
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.checks.forces import rigid_motion
from dap3d_core.testing.samples.random_state import Direction
from dap3d_core.testing.samples.sampled_type import UNDEFINED, SampledType

# Texts of findings: formats of the wrong number x and of further words.
_TANGENT = (
    "row {x.n} of rate has another tangent than it seems: its derivative by {by} is {x.is_:.6g} by "
    "complex step, which linearisation relies on, and {x.should:.6g} by differences"
)
_FRAME = (
    "row {x.n} of rate notices where ground is: it was {x.should:.6g} and is {x.is_:.6g} after a "
    "common {motion} of all bodies; a state is a number, or numbers along the axes of a body"
)


def tangent(subject: SampledType) -> CheckOutcome:
    """The derivatives of the rates by the motion of the bodies and by the states."""
    c = Comparison("rate", subject, "rate", "the tangent of rate against differences")
    for name in _unread(subject):
        c.note(f"no kernel but rate reads the state {name}: it changes no motion")
    for sample in subject.samples:
        slots, count = len(sample.kernels.type_info.layout.slots), len(sample.state.own)
        along = [(Direction.of(slot, k), body_words(sample, slot, k))
                 for slot in range(slots) for k in range(6)]  # fmt: skip
        along += [(Direction.of_state(k, count), f"state {k + 1}") for k in range(count)]
        for direction, by in along:
            found = rates(sample, "rate", direction, c)
            if len(found) > 1:  # else it takes no complex numbers, which is noted
                step, difference = found
                c.compare(sample, step.value, difference.value, _TANGENT, words={"by": by},
                          tolerance=difference.tolerance, bound=difference.bound)  # fmt: skip
    return c.outcome()


def frame(subject: SampledType) -> CheckOutcome:
    """A common rigid motion of all bodies leaves the rates as they are."""
    c = Comparison("rate frame", subject, "rate", "a common rigid motion leaves the rates alone")
    for k, sample in enumerate(subject.samples):
        value = sample.value("rate")
        for velocity in (False, True):
            moved, _ = rigid_motion(sample.state, subject.seed, k, velocity=velocity)
            try:
                got = attrs.evolve(sample, state=moved).value("rate")
            except UNDEFINED:
                continue
            if np.isfinite(got).all():
                words = {"motion": "velocity" if velocity else "rigid motion"}
                size = float(np.max(np.abs(value), initial=0.0))
                c.compare(sample, got, value, _FRAME, words=words, scale=size)
    return c.outcome()


def _unread(subject: SampledType) -> list[str]:
    """States that no kernel but ``rate`` reads."""
    kernels = subject.type_info.kernels
    read = {n for name, kernel in kernels.items() if name != "rate" for n in parameters(kernel)}
    return [name for name in subject.type_info.layout.states if name not in read]
