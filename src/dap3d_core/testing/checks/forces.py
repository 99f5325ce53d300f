"""Checks of a force, and of the friction of a joint: energy, balance, rigid motions."""

import random
from collections.abc import Callable

import attrs
import numpy as np

from dap3d_core.interface.examine.random_values import numbers, random_pose
from dap3d_core.testing.checks.compare import Comparison, Wrong, body_words, rates
from dap3d_core.testing.checks.findings import Outcome
from dap3d_core.testing.samples.random_state import Direction, Floats, State, rotation
from dap3d_core.testing.samples.sampled_type import UNDEFINED, Sample, SampledType


def potential(subject: SampledType) -> Outcome:
    """At rest the wrench is minus the derivative of the energy."""
    c = Comparison("energy", subject, "energy", "the wrench at rest against -dE/dq")
    for sample in subject.samples:
        still = attrs.evolve(sample, state=sample.state.at_rest())
        wrench = _wrench(still, "wrench")
        if wrench is None:
            c.note("the wrench at rest is undefined at some poses: these were left out")
            continue
        for slot in range(len(wrench)):
            for column in range(6):
                for rate in rates(still, "energy", Direction.of(slot, column), c):
                    got = wrench[slot, column // 3, column % 3]
                    says = _about_energy(still, slot, column, rate.way)
                    c.compare(still, np.array([got]), -rate.value, says, bound=rate.bound,
                              tolerance=rate.tolerance, rows=[6 * slot + column],
                              scale=float(np.max(np.abs(wrench))))  # fmt: skip
    return c.outcome()


def _about_energy(sample: Sample, slot: int, column: int, way: str) -> Callable[[Wrong], str]:
    by, axis = body_words(sample, slot, column), "xyz"[column % 3]
    letter = sample.kernels.examined.layout.slots[slot]
    what = f"the {'force' if column < 3 else 'moment'} on body {letter} along {axis}"
    return lambda x: (
        f"{what} and the energy disagree by {x.error:.3g} at this pose: at rest wrench gives "
        f"{x.is_:.6g}, and minus the derivative of energy by {by} is {x.should:.6g} ({way})"
    )


def balance(subject: SampledType, kernel: str = "wrench") -> Outcome:
    """Forces and moments on all bodies sum to zero."""
    c = Comparison("action and reaction", subject, kernel, "forces and moments sum to zero")
    for sample in subject.samples:
        wrench, r = sample.value(kernel), sample.state.r[1:]
        arms = np.cross(r[: len(wrench)], wrench[:, 0])
        moment = (wrench[:, 1] + arms).sum(axis=0)
        size = float(max(np.max(np.abs(wrench)), np.max(np.abs(arms))))
        c.compare(sample, wrench[:, 0].sum(axis=0)[None], 0.0,
                  _about_balance(kernel, "forces"), scale=size, rows=[0])  # fmt: skip
        says = _about_balance(kernel, "moments about the origin")
        c.compare(sample, moment[None], 0.0, says, scale=size, rows=[1])
    return c.outcome()


def _about_balance(kernel: str, what: str) -> Callable[[Wrong], str]:
    return lambda x: (
        f"{kernel} has no reaction: the {what} on all bodies sum to {x.is_:.3g} along "
        f"{'xyz'[x.index[-1]]} and should to zero: what acts on one body acts back on the others"
    )


def frame(subject: SampledType, kernel: str = "wrench") -> Outcome:
    """A common rigid motion of all bodies: the wrench turns with them."""
    c = Comparison("frame", subject, kernel, "a common rigid motion turns the wrench, no more")
    for k, sample in enumerate(subject.samples):
        wrench = sample.value(kernel)
        for velocity in (False, True):
            moved, R = rigid_motion(sample.state, subject.seed, k, velocity=velocity)
            c.kernel = kernel
            got = _wrench(attrs.evolve(sample, state=moved), kernel)
            if got is not None:
                for slot in range(len(wrench)):
                    says = _about_frame(sample, kernel, slot, velocity)
                    c.compare(sample, got[None, slot], (wrench[slot] @ R.T)[None], says,
                              scale=float(np.max(np.abs(wrench))), rows=[slot])  # fmt: skip
        if "energy" in subject.kernels.names():
            c.kernel = "energy"
            c.compare(
                sample, sample.value("energy", moved), sample.value("energy"), _about_energy_frame
            )
    return c.outcome()


def _about_frame(sample: Sample, kernel: str, slot: int, velocity: bool) -> Callable[[Wrong], str]:
    letter = sample.kernels.examined.layout.slots[slot]
    how = "a common velocity of all bodies" if velocity else "a common rigid motion of all bodies"
    return lambda x: (
        f"{kernel} notices where ground is: after {how} the "
        f"{'moment' if x.index[0] else 'force'} on body {letter} along {'xyz'[x.index[1]]} is "
        f"{x.is_:.6g} and should be {x.should:.6g}, what it was, turned with the bodies"
    )


def _about_energy_frame(x: Wrong) -> str:
    return (
        f"energy notices where ground is: it was {x.should:.6g} and is {x.is_:.6g} after a common "
        "rigid motion of all bodies"
    )


def dissipation(subject: SampledType) -> Outcome:
    """The power of friction is not positive."""
    c = Comparison("friction", subject, "friction", "the power of friction is negative or zero")
    for sample in subject.samples:
        wrench = sample.value("friction")
        v = np.stack([sample.state.v, sample.state.w], axis=1)[1 : len(wrench) + 1]
        power = np.sum(wrench * v)
        c.compare(sample, np.array([max(power, 0.0)]), 0.0,
                  lambda x: f"friction drives: its power is {x.is_:.3g} and should not be positive",
                  scale=float(np.sum(np.abs(wrench * v))))  # fmt: skip
    return c.outcome()


def rigid_motion(
    state: State, seed: int, k: int, *, velocity: bool = False
) -> tuple[State, Floats]:
    """The state after a common rigid motion, with ``velocity`` also in motion; the rotation."""
    rng = random.Random(f"{seed} {k}")
    q, shift = np.array(random_pose(rng).p), np.array(numbers(rng, 3))
    speed, spin = (np.array(numbers(rng, 3)) * velocity for _ in range(2))
    return state.together(q, shift, speed, spin), rotation(q[None])[0]


def _wrench(sample: Sample, kernel: str) -> Floats | None:
    try:
        wrench = sample.value(kernel)
    except UNDEFINED:
        return None
    return wrench if np.isfinite(wrench).all() else None
