"""Checks of jumps: rows against switches, restitution, impulses that push and come to rest."""

import attrs
import numpy as np

from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rotations import rotation
from dap3d_core.testing.checks.compare import Comparison, body_words, rates
from dap3d_core.testing.checks.elements import rigid_motion
from dap3d_core.testing.checks.findings import CheckOutcome
from dap3d_core.testing.samples.random_state import Direction, State
from dap3d_core.testing.samples.sampled_type import Sample, SampledType

#: Factors of the random velocities: both senses, and fast enough for what rests below a speed.
SPEEDS = (1.0, -1.0, 1e3, -1e3)
#: A change of a rate below this part of the rate is rounding.
RATE_ROUNDING = 1e-9

# Texts of findings: formats of the wrong number x and of further words.
_ROWS = (
    "J and switch disagree: the rate of switch {x.n} by {by} is {x.should:.6g} ({way}), and J has "
    "{x.is_:.6g}; impulse would be called with another rate than that of the gap"
)
_ENERGY = (
    "impulse creates energy: the rate {rate:.6g} of row {x.n} becomes {x.is_:.6g}, faster than it "
    "came, with {e} = {value:.6g}"
)
_RESTITUTION = (
    "impulse does not follow {e} = {value:.6g}: the rate {rate:.6g} of row {x.n} becomes "
    "{x.is_:.6g} and should {x.should:.6g}, -{e} times the rate, or stay as it is"
)
_PARTING = (
    "impulse acts on what parts: the rate {rate:.6g} of row {x.n} is positive already, and becomes "
    "{x.is_:.6g}"
)
_PULLS = (
    "row {x.n} is declared unilateral, and impulse asks for the change {x.is_:.6g} of its rate "
    "{rate:.6g}: it would have to pull"
)
_RESTLESS = (
    "impulse does not come to rest: with the velocities that it asked for, J v of row {x.n} being "
    "{rate:.6g}, it asks for a further change {x.is_:.6g}; the next round would not be the last"
)
_GROWTH = (
    "impulse creates energy: crossing to {side}, the kinetic energy of free bodies grows by "
    "{percent:.3g} %, from {before:.6g} to {after:.6g} J, by an impulse that follows their "
    "velocities; of a type that is to drive them say gives_energy = True"
)
_BALANCE = (
    "row {x.n} of J has no reaction: the {what} that its impulse makes on all bodies sum to "
    "{x.is_:.3g} along {axis} and should to zero"
)
_FRAME = (
    "row {x.n} of J notices where ground is: after a common rigid motion of all bodies its part of "
    "body {letter} is {x.is_:.6g} and should be {x.should:.6g}, what it was, turned with the bodies"
)
_FRAME_IMPULSE = (
    "impulse notices where ground is: after a common motion of all bodies row {x.n} asks for the "
    "change {x.is_:.6g} and should for {x.should:.6g}, as before"
)


def has_rows(subject: SampledType | Sample) -> bool:
    """True for a force whose jumps are given by rows."""
    type_info = subject.kernels.type_info
    return type_info.type.kind == "force" and "J" in subject.kernels.names()


def why_no_gap(subject: SampledType) -> str:
    """The reason why the rows need not be the rates of the switches; "" where they are."""
    info = subject.type_info
    if not subject.type.restitution:
        return "it declares no restitution, so that its rows need not be rates of its switches"
    if len(info.outputs["switch"]) != len(info.outputs["impulse"]):
        return "it has not as many switches as rows"
    if any(info.names[n].velocity for n in parameters(info.kernels["switch"])):
        return "its switch depends on velocities"
    if any(spec.kind == "angle" for spec in specs_of(subject.type).values()):
        return "it has an angle, whose rate is that of a formula off the common axis"
    return ""


def rows(subject: SampledType) -> CheckOutcome:
    """The rows of J are the rates of the switches."""
    c = Comparison("jump rows", subject, "J", "J against the derivative of switch")
    for sample in subject.samples:
        J = sample.value("J")
        for slot in range(len(J)):
            for column in range(6):
                for rate in rates(sample, "switch", Direction.of(slot, column), c):
                    words = {"by": body_words(sample, slot, column), "way": rate.way}
                    c.compare(sample, J[slot, :, column], rate.value, _ROWS, words=words,
                              bound=rate.bound, tolerance=rate.tolerance,
                              scale=float(np.max(np.abs(J))))  # fmt: skip
    return c.outcome()


def restitution(subject: SampledType) -> CheckOutcome:
    """Rates of rows become -e times what they were, or stay; those that part stay."""
    field = subject.type.restitution
    words = f"rates after against -{field} times those before"
    c = Comparison("restitution", subject, "impulse", words)
    for sample, state in _in_motion(subject):
        value = float(sample.element.fields[field])
        before = _rates(sample.value("J"), state)
        after = before + sample.value("impulse", state)
        for k, (rate, new) in enumerate(zip(before, after, strict=True)):
            if abs(new - rate) <= RATE_ROUNDING * abs(rate):
                continue
            parts, faster = rate >= 0.0, abs(new) > (1.0 + RATE_ROUNDING) * abs(rate)
            text = _PARTING if parts else _ENERGY if faster else _RESTITUTION
            c.compare(sample, np.array([new]), rate if parts else -value * rate, text,
                      words={"e": field, "value": value, "rate": rate}, rows=[k])  # fmt: skip
    return c.outcome()


def pushing(subject: SampledType) -> CheckOutcome:
    """Rows that push are asked for changes that are not negative."""
    c = Comparison("unilateral", subject, "impulse", "rows that push have no negative change")
    for sample, state in _in_motion(subject):
        before, change = _rates(sample.value("J"), state), sample.value("impulse", state)
        for k in subject.type.unilateral:
            c.compare(sample, change[[k]], np.maximum(change[[k]], 0.0), _PULLS,
                      words={"rate": before[k]}, rows=[k])  # fmt: skip
    return c.outcome()


def settling(subject: SampledType) -> CheckOutcome:
    """With the velocities that it asked for, of free bodies, it asks for nothing more."""
    c = Comparison("round", subject, "impulse", "no further change after the one asked for")
    for sample, state in _in_motion(subject):
        J, change = sample.value("J"), sample.value("impulse", state)
        moved = _after(J, change, state)
        if moved is None:
            c.note("the rows depend on each other at some poses: these were left out")
            continue
        still = attrs.evolve(sample, kernels=attrs.evolve(sample.kernels, crossing=0.0))
        new = _rates(J, moved)
        for k, more in enumerate(still.value("impulse", moved)):
            c.compare(sample, np.array([more]), 0.0, _RESTLESS, words={"rate": new[k]},
                      scale=float(np.max(np.abs(change))), rows=[k])  # fmt: skip
    return c.outcome()


def balance(subject: SampledType) -> CheckOutcome:
    """An impulse of a row acts back: forces and moments on all bodies sum to zero."""
    c = Comparison("impulse and reaction", subject, "J", "impulses and moments sum to zero")
    for sample in subject.samples:
        J = sample.value("J")
        arms = np.cross(sample.state.r[1 : len(J) + 1, None], J[..., :3])
        size = float(max(np.max(np.abs(J)), np.max(np.abs(arms))))
        sums = {"impulses": J[..., :3].sum(axis=0),
                "moments about the origin": (J[..., 3:] + arms).sum(axis=0)}  # fmt: skip
        for what, of_rows in sums.items():
            for k, axis in enumerate("xyz"):
                c.compare(sample, of_rows[:, k], 0.0, _BALANCE, scale=size,
                          words={"what": what, "axis": axis})  # fmt: skip
    return c.outcome()


def frame(subject: SampledType) -> CheckOutcome:
    """A common rigid motion of all bodies turns the rows, and asks for the same changes."""
    c = Comparison("jump frame", subject, "J", "a common rigid motion turns the rows, no more")
    for k, sample in enumerate(subject.samples):
        J = sample.value("J")
        for velocity in (False, True):
            moved, R = rigid_motion(sample.state, subject.seed, k, velocity=velocity)
            c.kernel = "J"
            got, turned = sample.value("J", moved), J.reshape(*J.shape[:-1], 2, 3) @ R.T
            for slot, letter in enumerate(sample.kernels.type_info.layout.slots):
                c.compare(sample, got[slot], turned[slot].reshape(-1, 6), _FRAME,
                          words={"letter": letter}, scale=float(np.max(np.abs(J))))  # fmt: skip
            c.kernel = "impulse"
            asked = sample.value("impulse", moved)
            c.compare(sample, asked, sample.value("impulse"), _FRAME_IMPULSE)
    return c.outcome()


def energy(subject: SampledType) -> CheckOutcome:
    """Impulses of free bodies that follow their velocities add no kinetic energy."""
    c = Comparison("impulse energy", subject, "impulse", "kinetic energy after against before")
    for sample, state in _in_motion(subject):
        for side in (1.0, -1.0):
            there = attrs.evolve(sample, kernels=attrs.evolve(sample.kernels, crossing=side))
            dv = _change(there, state)
            if dv is None or not np.any(dv):
                continue
            along = attrs.evolve(state, v=_along(state, dv, 0), w=_along(state, dv, 1))
            for moving in (state, along):
                before = _kinetic(moving)
                dv = _change(there, moving)
                after = 0.0 if dv is None else _kinetic(
                    attrs.evolve(moving, v=moving.v + dv[0], w=moving.w + dv[1]))  # fmt: skip
                growth = after / before - 1.0 if before > 0.0 else 0.0
                c.compare(there, np.array([max(growth, 0.0)]), 0.0, _GROWTH,
                          words={"side": f"{side:+.0f}", "percent": 100.0 * growth,
                                 "before": before, "after": after})  # fmt: skip
    return c.outcome(sized=False)


def follows_velocities(subject: SampledType) -> bool:
    """True if an impulse depends on velocities: what does not is a charge of its own."""
    info = subject.type_info
    names = set(parameters(info.kernels["impulse"])) - {"crossing"}
    return any(n not in info.names or info.names[n].velocity for n in names)


def _change(sample: Sample, state: State) -> tuple[Floats, Floats] | None:
    """Changes of all velocities by an impulse on free bodies; None where rows depend."""
    impulse = sample.value("impulse", state)
    if has_rows(sample):
        J = sample.value("J", state)
        active = impulse != 0.0
        if not active.any():
            return None
        moved = _after(J[:, active], impulse[active], state)
        return None if moved is None else (moved.v - state.v, moved.w - state.w)
    dv, dw = np.zeros_like(state.v), np.zeros_like(state.w)
    for slot, (force, moment) in enumerate(impulse):
        if state.mass[slot + 1] > 0.0:
            dv[slot + 1] = force / state.mass[slot + 1]
            dw[slot + 1] = np.linalg.solve(_inertia(state, slot + 1), moment)
    return dv, dw


def _along(state: State, dv: tuple[Floats, Floats], which: int) -> Floats:
    """Velocities or angular velocities along those that an impulse has changed, as they were."""
    inertia = [_inertia(state, b) for b in range(len(state.mass))]
    mass = state.mass[:, None]

    def product(a: tuple[Floats, Floats], b: tuple[Floats, Floats]) -> float:
        return float(np.sum(mass * a[0] * b[0]) + np.einsum("bi,bij,bj", a[1], inertia, b[1]))

    size = product(dv, dv)
    return dv[which] * (product(dv, (state.v, state.w)) / size if size > 0.0 else 0.0)


def _kinetic(state: State) -> float:
    """Kinetic energy of all bodies, J."""
    terms = [w @ _inertia(state, b) @ w for b, w in enumerate(state.w)]
    return 0.5 * float(np.sum(state.mass[:, None] * state.v**2) + sum(terms))


def _inertia(state: State, b: int) -> Floats:
    """(3, 3) inertia of a body, global axes."""
    A = rotation(state.p[b])
    return A @ state.Jp[b].reshape(3, 3) @ A.T


def _in_motion(subject: SampledType) -> list[tuple[Sample, State]]:
    """The samples with their states at several speeds."""
    return [(sample, sample.state.at_speed(s)) for sample in subject.samples for s in SPEEDS]


def _rates(J: Floats, state: State) -> Floats:
    """(rows,) J v."""
    return np.einsum("src,sc->r", J, state.velocities(len(J)))


def _after(J: Floats, change: Floats, state: State) -> State | None:
    """The state with velocities changed by impulses of rows J; None where rows depend."""
    of_impulse = np.zeros_like(J)  # velocities that a unit impulse of each row gives
    for slot in range(len(J)):
        mass = state.mass[slot + 1]
        if mass > 0.0:  # ground has none
            inertia = _inertia(state, slot + 1)
            of_impulse[slot, :, :3] = J[slot, :, :3] / mass
            of_impulse[slot, :, 3:] = np.linalg.solve(inertia, J[slot, :, 3:].T).T
    K = np.einsum("src,sqc->rq", J, of_impulse)
    if np.linalg.cond(K) > 1.0 / RATE_ROUNDING:
        return None
    dv = np.einsum("src,r->sc", of_impulse, np.linalg.solve(K, change))
    return state.with_velocity(state.velocities(len(J)) + dv)
