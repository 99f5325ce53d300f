"""Spinning bodies: free ones and tops."""

from functools import partial

import numpy as np
from support import problems

from hard import references
from hard.case import Case, Try
from hard.linkages import PENALTY, USUAL, YIELDING
from hard.measures import at_all_instants, turning

LEAN, SPIN = np.radians(30.0), 200.0
#: Roots of A cos(th) W^2 - C wz W + m g l = 0, rad/s.
SLOW, FAST = 0.998260295360957858, 56.7367666236016186
COARSE = "five steps a radian of spin: h = 1e-4 it would take"
BODIES_TEST = "tests/verification/test_reference_problems.py"


def _axis_and_spin(result):
    """(nt, 4) axis of the top, and its spin as a part of what it should be."""
    return np.column_stack([result.r[:, 0] / 0.1, result.wp[:, 0, 2] / SPIN])


def _steady(precession, t):
    return np.column_stack([references.top_axis(LEAN, precession, t), np.ones(len(t))])


def _free(name, title, hard, w, floor=0.0):
    J = (1.0, 2.0, 3.0)
    return Case(
        name, title, hard, partial(problems.free_body, J, w), 10.0, 0.1, turning(J, w),
        "e of omega (body axes) and Euler parameters, 100 instants",
        "Euler's equations, DOP853 at 3e-14", USUAL, BODIES_TEST, floor=floor,
    )  # fmt: skip


def _top(name, hard, precession, penalty, loose=1e3):
    return Case(
        name, "heavy top in steady precession", hard,
        partial(problems.heavy_top, LEAN, SPIN, precession), 10.0, 0.05,
        at_all_instants(_axis_and_spin, partial(_steady, precession)),
        "e of axis and spin, 200 instants; nutation would show in it",
        "A cos(th) W^2 - C wz W + m g l = 0",
        (*USUAL, penalty, Try("rk4", settings={"step": 1e-3}, why=COARSE)),
        BODIES_TEST, loose=loose,
    )  # fmt: skip


BODIES = (
    _free("G1", "asymmetric free body",
          "no force and no joint: error shows in energy and momentum, nothing damps it",
          (1.0, 2.0, 0.5)),
    _free("flips", "Dzhanibekov's flips",
          "omega = (0.001, 5, 0.001) about the middle axis: what is small decides when it turns "
          "over, and each flip multiplies errors by a thousand",
          (0.001, 5.0, 0.001), floor=1e-7),  # three flips make that of rounding, 1e-16
    _top("slow top", "200 rad/s of spin for 1 rad/s of precession: 2000 rad are integrated to see "
         "10 of them; the steps are those of the spin", SLOW, PENALTY),
    # nodding is neither damped nor driven, so that the errors of 40 000 steps add up
    _top("fast top", "precession at 57 rad/s; the slightest error makes it nod (nutation)", FAST,
         YIELDING, loose=1e4),
)  # fmt: skip
