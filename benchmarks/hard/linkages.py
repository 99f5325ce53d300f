"""Cases of the IFToMM library (A01 to A05), singular poses, redundant rows."""

from functools import partial

import numpy as np
from support import problems, redundant

import dap3d_core as dap
from hard import references
from hard.case import Case, Try
from hard.measures import against_digits, at_all_instants, crank_tip, first_body

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
SPRINGS = "its joints are springs: accelerations, and so the motion, are off by 1 / alpha"
DEPENDENT = "refuses dependent rows at the start; lsq, which auto takes, does not"
UNPLACED = "beyond its limit: crossings, which dop853 takes it across, multiply errors of its steps"
SCATTERED = (
    "0.25 to 2.2 times the limit, by the last digits of rtol: it has no steps placed about the "
    "poses"
)
NARROW = "1.3 times the limit: it has no steps placed about the poses"
OFF = "stages off the constraints by 1e-6 have no acceleration to speak of close to the pose"
#: What is tried on every case.
EXPLICIT = (Try(), Try(settings=TIGHT), Try("dopri5"))
ADAMS = Try("adams")
USUAL = (*EXPLICIT, ADAMS, Try("radau"))
#: The same where the mechanism passes a singular pose.
ACROSS = (*EXPLICIT, ADAMS, Try("radau", why=UNPLACED))
#: The penalty method where its springs are stiff enough, and where they are not.
PENALTY, YIELDING = Try(method="penalty"), Try(method="penalty", why=SPRINGS)
REFUSED = Try(method="standard", why=DEPENDENT)
SINGULAR = "tests/verification/test_singular_poses.py"
ON_DIGITS = "a high-precision computation in minimal coordinates (expected.toml of the model)"


def _bars(count, tries, test):
    return Case(
        f"A02, N = {count}",
        f"{count} parallelogram{'s' if count > 1 else ''} in a row, spatial revolutes",
        f"3 redundant rows a loop everywhere; when all links are in line the rank falls by {count} "
        "more, eight times in 10 s",
        partial(redundant.four_bars, count),
        10.0,
        0.05,
        at_all_instants(crank_tip, partial(references.four_bars, count)),
        "e of B0's place and velocity, 200 instants",
        "the one equation of the cranks, DOP853 at 3e-14",
        tries,
        test,
        slow=count > 2,
    )


def _door_tip(result):
    return np.hstack([result.r[:, 0, 1:], result.rd[:, 0, 1:]])


def _door(t):
    m, length, J = 12.0, 0.5, 4.0
    rate = m * references.G * length / (J + m * length**2)
    phi, w = references.swing(rate, (np.pi / 2, 0.0), t).T
    s, c = np.sin(phi), np.cos(phi)
    return length * np.column_stack([-s, c, -c * w, -s * w])


LINKAGES = (
    Case(
        "A01", "pendulum, a point on a massless rod",
        "the rod's tension, not its length, is what sloppy stabilisation loses",
        problems.pendulum, 10.0, 0.05,
        at_all_instants(first_body, references.pendulum),
        "e of place and velocity, 200 instants", "Jacobi's elliptic functions",
        (*USUAL, YIELDING, Try("rk4", settings={"step": 1e-3})),
        "tests/verification/test_reference_problems.py",
    ),
    _bars(1, (*EXPLICIT, Try("adams", why=SCATTERED), Try("radau", why=UNPLACED), REFUSED,
              YIELDING), SINGULAR),
    _bars(2, (*EXPLICIT, Try("adams", why=NARROW), Try("radau", why=UNPLACED), REFUSED, YIELDING),
          SINGULAR),
    _bars(40, (*EXPLICIT, REFUSED), SINGULAR),
    Case(
        "four-bar, flat", "one parallelogram, independent rows",
        "redundant at one pose alone: in line the rank falls, and a rounding c of places d from "
        "there is one of c / d^3 in accelerations",
        problems.four_bar, 10.0, 0.05,
        at_all_instants(crank_tip, partial(references.four_bars, 1)),
        "e of B0's place and velocity, 200 instants",
        "the one equation of the cranks, DOP853 at 3e-14",
        (*ACROSS, Try(settings={"project": False}, why=OFF),
         Try("rk4", settings={"step": 1e-3})),
        SINGULAR,
    ),
    Case(
        "A03", "Andrews' squeezing mechanism",
        "three loops, four bodies on one pin; mm, g and ms: masses of 4e-3 kg, inertias of 4e-7, "
        "accelerations of 5e5",
        partial(dap.load, "A03"), 0.05, 5e-4,
        against_digits("A03", ("rP.F1", "p.K1", "p.K3", "w.K1", "rP.E3")),
        "e of points, orientations, spin at 0.01 and 0.05 s", ON_DIGITS,
        (*USUAL, PENALTY), "tests/models/test_expected.py",
    ),
    Case(
        "A04", "Bricard's mechanism",
        "30 rows of rank 29 wherever it stands: by count nothing could move",
        partial(dap.load, "A04"), 2.0, 0.05,
        against_digits("A04", ("rP.P3", "p.rod3", "p.rod5")),
        "e of the third joint and two rods at 0.5, 1 and 2 s", ON_DIGITS,
        (*USUAL, REFUSED, PENALTY), SINGULAR,
    ),
    Case(
        "A05", "stiff flyball governor",
        "a fastest eigenvalue of -8117 1/s beside a motion of 7 rad/s",
        partial(dap.load, "A05"), 0.5, 0.05,
        against_digits("A05", ("r.slider", "r.right", "p.left", "p.shaft")),
        "e of slider, arms and shaft at 0.05, 0.1 and 0.5 s", ON_DIGITS,
        (*USUAL, Try("radau", settings=TIGHT), PENALTY,
         Try("rk4", settings={"step": 4e-4},
             why="unstable: 2.785 / 8117 1/s = 3.4e-4 s is its longest step")),
        "tests/verification/test_implicit.py",
    ),
    Case(
        "door, 5 hinges", "a door on five coaxial hinges",
        "25 rows of rank 5 everywhere: four hinges more than it needs",
        partial(redundant.hinged_door, 5), 5.0, 0.05,
        at_all_instants(_door_tip, _door), "e of place and velocity of its centre, 100 instants",
        "the equation of the pendulum, DOP853 at 3e-14",
        (*USUAL, REFUSED, PENALTY), SINGULAR,
    ),
)  # fmt: skip
