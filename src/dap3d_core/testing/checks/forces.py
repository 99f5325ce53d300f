"""Checks of a force, and of the friction of a joint: energy, balance, rigid motions."""

import random

import attrs
import numpy as np

from dap3d_core.interface.examine.random_values import numbers, random_pose
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rotations import rotation
from dap3d_core.testing.checks.compare import Comparison, body_words, rates
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.random_state import Direction, State
from dap3d_core.testing.samples.sampled_type import UNDEFINED, Sample, SampledType

# Texts of findings: formats of the wrong number x and of further words.
_ENERGY = (
    "the {part} on body {letter} along {axis} and the energy disagree by {x.error:.3g} at this "
    "pose: at rest wrench gives {x.is_:.6g}, and minus the derivative of energy by {by} is "
    "{x.should:.6g} ({way})"
)
_BALANCE = (
    "{kernel} has no reaction: the {what} on all bodies sum to {x.is_:.3g} along {x.axis} and "
    "should to zero: what acts on one body acts back on the others"
)
_FRAME = (
    "{kernel} notices where ground is: after a common {motion} of all bodies the {x.part} on body "
    "{letter} along {x.axis} is {x.is_:.6g} and should be {x.should:.6g}, what it was, turned with"
    " the bodies"
)
_ENERGY_FRAME = (
    "energy notices where ground is: it was {x.should:.6g} and is {x.is_:.6g} after a common rigid"
    " motion of all bodies"
)


def potential(subject: SampledType) -> CheckOutcome:
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
                direction = _with_states(still, Direction.of(slot, column))
                for rate in rates(still, "energy", direction, c):
                    got = wrench[slot, column // 3, column % 3]
                    letter = still.kernels.type_info.layout.slots[slot]
                    words = dict(
                        part="force" if column < 3 else "moment", letter=letter,
                        axis="xyz"[column % 3], by=body_words(still, slot, column), way=rate.way,
                    )  # fmt: skip
                    c.compare(still, np.array([got]), -rate.value, _ENERGY, words=words,
                              bound=rate.bound,
                              tolerance=rate.tolerance, rows=[6 * slot + column],
                              scale=float(np.max(np.abs(wrench))))  # fmt: skip
    return c.outcome()


def _with_states(still: Sample, along: Direction) -> Direction:
    """A direction of the bodies with what states follow of it: their rates less those at rest."""
    if not len(still.state.own):
        return along
    moving = attrs.evolve(still.state, v=along.move, w=along.turn)
    return attrs.evolve(along, own=still.value("rate", moving) - still.value("rate"))


def balance(subject: SampledType, kernel: str = "wrench") -> CheckOutcome:
    """Forces and moments on all bodies sum to zero."""
    c = Comparison("action and reaction", subject, kernel, "forces and moments sum to zero")
    for sample in subject.samples:
        wrench, r = sample.value(kernel), sample.state.r[1:]
        arms = np.cross(r[: len(wrench)], wrench[:, 0])
        moment = (wrench[:, 1] + arms).sum(axis=0)
        size = float(max(np.max(np.abs(wrench)), np.max(np.abs(arms))))
        words = {"kernel": kernel, "what": "forces"}
        force = wrench[:, 0].sum(axis=0)
        c.compare(sample, force[None], 0.0, _BALANCE, words=words, scale=size, rows=[0])
        words = {"kernel": kernel, "what": "moments about the origin"}
        c.compare(sample, moment[None], 0.0, _BALANCE, words=words, scale=size, rows=[1])
    return c.outcome()


def frame(subject: SampledType, kernel: str = "wrench") -> CheckOutcome:
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
                    motion = "velocity" if velocity else "rigid motion"
                    letter = sample.kernels.type_info.layout.slots[slot]
                    words = {"kernel": kernel, "motion": motion, "letter": letter}
                    c.compare(sample, got[None, slot], (wrench[slot] @ R.T)[None], _FRAME,
                              words=words, scale=float(np.max(np.abs(wrench))),
                              rows=[slot])  # fmt: skip
        if "energy" in subject.kernels.names():
            c.kernel = "energy"
            c.compare(sample, sample.value("energy", moved), sample.value("energy"), _ENERGY_FRAME)
    return c.outcome()


def dissipation(subject: SampledType) -> CheckOutcome:
    """The power of friction is not positive."""
    c = Comparison("friction", subject, "friction", "the power of friction is negative or zero")
    for sample in subject.samples:
        wrench = sample.value("friction")
        v = np.stack([sample.state.v, sample.state.w], axis=1)[1 : len(wrench) + 1]
        power = np.sum(wrench * v)
        c.compare(sample, np.array([max(power, 0.0)]), 0.0,
                  "friction drives: its power is {x.is_:.3g} and should not be positive",
                  scale=float(np.sum(np.abs(wrench * v))))  # fmt: skip
    return c.outcome()


def unloaded(subject: SampledType) -> CheckOutcome:
    """A force on reactions is finite where the joints carry nothing, as at the start of a run."""
    c = Comparison("unloaded", subject, "wrench", "the wrench is finite where joints carry nothing")
    for sample in subject.samples:
        no_load = attrs.evolve(sample.element, lam=(0.0,) * len(sample.element.lam))
        try:
            finite = bool(np.isfinite(attrs.evolve(sample, element=no_load).value("wrench")).all())
        except UNDEFINED:
            finite = False
        if not finite:
            c.fail(
                "the wrench is no finite number where the reactions that it reads are zero; a run "
                "begins so, and joints are unloaded at times: divide by no load",
                sample,
            )
            break
    return c.outcome(sized=False)


def rigid_motion(
    state: State, seed: int, k: int, *, velocity: bool = False
) -> tuple[State, Floats]:
    """The state after a common rigid motion, with ``velocity`` also in motion; the rotation."""
    rng = random.Random(f"{seed} {k}")
    q, shift = np.array(random_pose(rng).p), np.array(numbers(rng, 3))
    speed, spin = (np.array(numbers(rng, 3)) * velocity for _ in range(2))
    return state.together(q, shift, speed, spin), rotation(q)


def _wrench(sample: Sample, kernel: str) -> Floats | None:
    try:
        wrench = sample.value(kernel)
    except UNDEFINED:
        return None
    return wrench if np.isfinite(wrench).all() else None
