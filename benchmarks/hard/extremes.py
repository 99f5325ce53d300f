"""Extremes: bounces without end, spins of 1e5 rad/s, a disk that nearly lies, a very long chain."""

from functools import partial

import numpy as np
import scenes as sizes
from support import problems

from dap3d_core.model.rotations import rotation
from hard import references, scenes
from hard.bodies import BODIES_TEST, LEAN
from hard.case import Case, Try, relative_error
from hard.linkages import EXPLICIT, TIGHT
from hard.measures import at_all_instants, first_body

HERE = "tests/verification/test_hard_cases.py"
SPIN = 1e5
#: Slow root of A cos(th) W^2 - C wz W + m g l = 0 at wz = SPIN, so written that no digit is lost.
PRECESSION = 2.0 * 0.981 / (500.0 + np.sqrt(500.0**2 - 4.0 * 0.02 * np.cos(LEAN) * 0.981))
STIFF, RESTITUTION, DROP = 1e9, 0.8, 0.9
LONG = 10_000
ROUNDED = (
    "rounding of w^2 = 1e10 rad/s^2 in a step of 1e-5 s is 1e-11 rad/s, and 1e-13 is asked for: "
    "steps shrink, 20 s do not suffice"
)


def _spun(result):
    """(nt, 3) the first axis of the body, and its spin as a part of what it should be."""
    p = result.p[:, 0]
    axis = [p[:, 0] ** 2 - p[:, 3] ** 2, 2.0 * p[:, 0] * p[:, 3]]
    return np.column_stack([*axis, result.wp[:, 0, 2] / SPIN])


def _turned(result):
    """Error e of a unit axis and of the spin, as parts of one."""
    angle = SPIN * result.t
    expected = np.column_stack([np.cos(angle), np.sin(angle), np.ones(len(angle))])
    return relative_error(_spun(result)[1:], expected[1:], small=1.0)


def _top(result):
    return np.column_stack([result.r[:, 0] / 0.1, result.wp[:, 0, 2] / SPIN])


def _precessing(t):
    return np.column_stack([references.top_axis(LEAN, PRECESSION, t), np.ones(len(t))])


def _bounces(result):
    """Error e of the instants of all touches and leavings."""
    found = np.array([event.t for event in result.events])
    all_ = np.array(references.bounces(1.0, STIFF, scenes.damper(STIFF, RESTITUTION), DROP))
    expected = all_[all_ <= result.t[-1]]
    return relative_error(found, expected) if len(found) == len(expected) else np.inf


def _leaning(lean, result):
    """Error e of the horizontal part of the axis and of the height, as parts of the lean's sine."""
    sine, rate = np.sin(lean), references.euler_disk(0.5, lean)
    axis = np.array([rotation(p)[:2, 1] for p in result.p[:, 0]])
    found = np.column_stack([axis / sine, result.r[:, 0, 2] / (0.5 * sine)])
    turned = rate * result.t
    expected = np.column_stack([np.cos(turned), np.sin(turned), np.ones(len(turned))])
    return relative_error(found[1:], expected[1:], small=0.1)


def _flat(lean, floor):
    turn = 2.0 * np.pi / references.euler_disk(0.5, lean)
    return Case(
        f"flat disk, {lean:g}", f"a disk that rolls, {lean:g} rad from lying down",
        f"its point of contact runs round at {references.euler_disk(0.5, lean):.3g} rad/s while "
        f"the disk hardly turns; all that moves is {lean:g} of its size",
        partial(scenes.flat_disk, lean), 10.0 * turn, turn / 20.0, partial(_leaning, lean),
        "e of the axis' horizontal part and the height, as parts of the lean; 200 instants",
        "steady rolling: Omega^2 = m g R / (J_t sin a)",
        EXPLICIT, "tests/verification/test_disk.py", floor=floor,
    )  # fmt: skip


def _beside(result):
    """(nt, 5) of the pendulum, and the weight on the spring as a part of its sag."""
    return np.column_stack([first_body(result), result.r[:, 1, 1] * STIFF / -references.G])


def _at_rest(t):
    return np.column_stack([references.pendulum(t), np.ones(len(t))])


EXTREMES = (
    Case(
        "stiff beside slow", "A01 beside a weight on a spring of 1e9 N/m, with a damper",
        "what has died away within 1e-3 s, 3e4 1/s, sets the steps for a motion of 3 rad/s",
        scenes.stiff_beside_slow, 1.0, 0.05, at_all_instants(_beside, _at_rest),
        "e of the pendulum's place and velocity and of the weight's sag, 20 instants",
        "A01 by elliptic functions; m g / k",
        (*EXPLICIT, Try("adams"), Try("radau")), HERE,
    ),
    Case(
        "Zeno", "a ball that bounces back with 0.8 of its speed, on ground of 1e9 N/m",
        "ever shorter flights, 33 of them, that add up to a finite time: from 0.86 s to 0.6 ms",
        scenes.bounces, 3.854, 0.01, _bounces,
        "e of the instants of all touches and leavings",
        "parabolas and damped sines, joined at each touch",
        EXPLICIT, HERE,
        loose=1e4,  # a late instant has the errors of all the contacts before
    ),
    Case(
        "spinning disk", "a free disk at 1e5 rad/s for 1 s", "16 000 turns; the steps are those of "
        "the spin, whose errors all have one sign",
        partial(problems.free_body, (1.0, 1.0, 2.0), (0.0, 0.0, SPIN)), 1.0, 0.01,
        _turned, "error of the direction of an axis, 100 instants",
        "the angle is 1e5 t", (Try(), Try(settings=TIGHT), Try("adams")), HERE,
        loose=1e4,  # 1e5 rad, each with its own error of one sign
    ),
    Case(
        "top at 1e5 rad/s", "heavy top in steady precession",
        "1e5 rad/s of spin for 0.002 rad/s of precession: 5e7 to 1",
        partial(problems.heavy_top, LEAN, SPIN, PRECESSION), 0.5, 0.01,
        at_all_instants(_top, _precessing), "e of axis and spin, 50 instants",
        "A cos(th) W^2 - C wz W + m g l = 0",
        (Try(), Try(settings=TIGHT, why=ROUNDED), Try("adams")), BODIES_TEST,
    ),
    _flat(1e-3, 0.0),
    _flat(1e-6, 1e-6),  # what rounding, 1e-16 a step, is of 1e-6, over a thousand rad
    Case(
        "chain of 10 000", "rods on spherical joints, let go from level",
        "60 000 coordinates and 30 000 multipliers; what happens at one end takes all of them "
        "to reach the other",
        partial(sizes.planar_chain, LONG), 0.1, 0.05,
        at_all_instants(lambda result: np.column_stack([result.r[:, -1, 1], result.rd[:, -1, 1]]),
                        references.fall),
        "e of the last rod's height and velocity", "it falls freely",
        (Try(),), HERE, slow=True,
    ),
)  # fmt: skip
