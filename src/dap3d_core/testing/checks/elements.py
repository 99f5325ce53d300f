"""Checks of forces, of friction, of functions, of states, and of normals and grips of contacts.

Energy, balance, rigid motions; derivatives; resistance to rolling and spinning.
"""

import random
from collections.abc import Mapping

import attrs
import numpy as np

from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.contacts.resistance import RESISTED
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
_TANGENT = (
    "row {x.n} of rate has another tangent than it seems: its derivative by {by} is {x.is_:.6g} by "
    "complex step, which linearisation relies on, and {x.should:.6g} by differences"
)
_RATE_FRAME = (
    "row {x.n} of rate notices where ground is: it was {x.should:.6g} and is {x.is_:.6g} after a "
    "common {motion} of all bodies; a state is a number, or numbers along the axes of a body"
)

#: Arguments of each random function.
ARGUMENTS = 8
_WRONG = (
    "{f} is wrong by {x.error:.3g} at x = {at:.6g}: it is {x.is_:.6g} and should be "
    "{x.should:.6g}, the derivative of {g} ({way})"
)
#: Names of what functions of one argument, of two return; of each argument (derivative, of which).
NAMES: tuple[str, ...] = ("f", "f'", "f''", "f'''")
CHAIN: Mapping[str, tuple[tuple[int, int], ...]] = {"x": ((1, 0), (2, 1), (3, 2))}
NAMES_OF_TWO = ("f", "f_x", "f_y", "f_xx", "f_xy", "f_yy")
CHAIN_OF_TWO = {"x": ((1, 0), (3, 1), (4, 2)), "y": ((2, 0), (4, 1), (5, 2))}
_WRONG_OF_TWO = (
    "{f} is wrong by {x.error:.3g} at x = {at:.6g}, y = {and_at:.6g}: it is {x.is_:.6g} and should "
    "be {x.should:.6g}, the derivative of {g} by {by} ({way})"
)

_LONG = "the normal is {x.is_:.6g} long; of another length than 1 forces, slip and gaps differ"
#: Part of its speed at which slip is next to nothing, and tolerance of coefficients there.
SLOW, CONTINUOUS = 1e-9, 1e-6
#: Speeds of slip at which coefficients are looked at, and halvings of what is between two of them.
SPEEDS, HALVINGS = 145, 50
_DRIVES = "grip gives {x.is_:.3g}: a negative coefficient of friction would drive"
_SPEEDS_UP = "resist gives {x.is_:.3g} m for {what}: what resists by a negative length would drive"
_NONE = "grip gives none along the grain, and {x.is_:.3g} across it; take a small one"
_STEPS = (
    "grip jumps from {x.should:.6g} to {x.is_:.6g} as slip becomes faster; let it change over a "
    "small range of speeds"
)
_JUMPS = (
    "grip jumps where slip begins: it gives {x.is_:.6g} at next to no speed and {x.should:.6g} at "
    "none"
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


def rate_frame(subject: SampledType) -> CheckOutcome:
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
                c.compare(sample, got, value, _RATE_FRAME, words=words, scale=size)
    return c.outcome()


def _unread(subject: SampledType) -> list[str]:
    """States that no kernel but ``rate`` reads."""
    kernels = subject.type_info.kernels
    read = {n for name, kernel in kernels.items() if name != "rate" for n in parameters(kernel)}
    return [name for name in subject.type_info.layout.states if name not in read]


def derivatives(subject: SampledType) -> CheckOutcome:
    """Numbers that ``value`` returns are derivatives of others; f_xy is that of f_x and of f_y."""
    what = "f', f'' and f''' against derivatives of f, f' and f''"
    names, partial, text, of_two = NAMES, CHAIN, _WRONG, subject.type.arguments > 1
    if of_two:
        what = "partial derivatives against derivatives of f, f_x and f_y"
        names, partial, text = NAMES_OF_TWO, CHAIN_OF_TWO, _WRONG_OF_TWO
    c = Comparison("derivatives", subject, "value", what)
    along = {"x": Direction.in_time(), "y": Direction.of_unknown(0, 1)}
    for k, sample in enumerate(subject.samples):
        rng = random.Random(f"{subject.seed} {k}")
        for _ in range(ARGUMENTS):
            x, y = rng.uniform(-0.5, 2.5), rng.uniform(-0.5, 2.5) if of_two else 0.0
            state = attrs.evolve(sample.state, t=x)
            if of_two:
                state = attrs.evolve(state, unknowns=np.array([[y, 0.0]]))
            here = attrs.evolve(sample, state=state)
            value = here.value("value")
            if not np.isfinite(value).all():
                continue
            for by, pairs in partial.items():
                for rate in rates(here, "value", along[by], c):
                    scale = float(np.max(np.abs([value[1:4], rate.value[:3]])))
                    for k, of in pairs:
                        words = {"f": names[k], "g": names[of], "at": x, "and_at": y, "by": by,
                                 "way": rate.way}  # fmt: skip
                        bound = None if rate.bound is None else rate.bound[of : of + 1]
                        c.compare(here, value[k : k + 1], rate.value[of : of + 1], text,
                                  words=words, tolerance=rate.tolerance, bound=bound, scale=scale,
                                  rows=[k])  # fmt: skip
    return c.outcome()


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
        near = sample.value("tension", sample.state.at_speed(SLOW))[-4:]
        c.compare(sample, np.minimum(mu, 0.0), 0.0, _DRIVES)
        c.compare(sample, np.where(mu[::2] == 0.0, mu[1::2], 0.0), 0.0, _NONE)
        c.compare(sample, near[:2], near[2:], _JUMPS, tolerance=CONTINUOUS)
        below, above = _largest_step(sample)
        c.compare(sample, above, below, _STEPS, tolerance=CONTINUOUS)
    return c.outcome()


def _largest_step(sample: Sample) -> tuple[Floats, Floats]:
    """Coefficients (2,) on both sides of the speed near which they change most."""

    def at(speed: float) -> Floats:
        return sample.value("tension", sample.state.at_speed(speed))[-4:-2]

    speeds = np.geomspace(SLOW, 1.0 / SLOW, SPEEDS)
    found = np.array([at(speed) for speed in speeds])
    k = int(np.argmax(np.max(np.abs(np.diff(found, axis=0)), axis=1)))
    low, high, below, above = speeds[k], speeds[k + 1], found[k], found[k + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        there = at(middle)
        if np.max(np.abs(there - below)) > np.max(np.abs(above - there)):
            high, above = middle, there
        else:
            low, below = middle, there
    return below, above


def resist(subject: SampledType) -> CheckOutcome:
    """Lengths of what resists rolling and spinning are not negative."""
    c = Comparison("resist", subject, "resist", "lengths are not negative")
    for k, (how, (_, what)) in enumerate(RESISTED.items()):
        for sample in subject.resisting(how).samples:
            length = np.minimum(sample.value("tension")[-1:], 0.0)
            c.compare(sample, length, 0.0, _SPEEDS_UP, words={"what": what}, rows=[k])
    return c.outcome()


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
