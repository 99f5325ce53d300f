"""Stiffness, contact, mass ratios, units."""

from functools import partial

import numpy as np

from hard import references, scenes
from hard.case import Case, Try
from hard.linkages import EXPLICIT, TIGHT, USUAL
from hard.measures import against_digits, at_all_instants, first_body

RATIO, K, DROP = 1e9, 1e9, 0.9
AS_LONG = "a step is as long as the contact; the ledger's energy is off by a quarter"
FAST_SPRING = "the errors of 67 000 undamped steps add up to twice the limit"
REGULARISED = "its regularisation, 1e-9 of a row's square, is of the size of a pivot here"
TOO_SOFT = "alpha = 1e7 is too soft for 1e9 kg"
HERE = "tests/verification/test_hard_cases.py"


def _height(result):
    """(nt, 2) height of the ball's lowest point and its velocity."""
    return np.column_stack([result.r[:, 0, 2] - 0.1, result.rd[:, 0, 2]])


def _bob(result):
    return np.hstack([result.r[:, 1, :2], result.rd[:, 1, :2]])


def _heavy_bob(t):
    """A pendulum of inertia 1/3 + ratio, m g l = (1/2 + ratio) g; phi from straight up."""
    rate = references.G * (0.5 + RATIO) / (1.0 / 3.0 + RATIO)
    phi, w = references.swing(rate, (np.pi / 2, 0.0), t).T
    s, c = np.sin(phi), np.cos(phi)
    return np.column_stack([-s, c, -c * w, -s * w])


def _on_cart(result):
    """As ``references.on_a_cart``, which has the cart's motion times 1 + ratio."""
    between = result.r[:, 1, :2] - result.r[:, 0, :2]
    cart = np.column_stack([result.r[:, 0, 0], result.rd[:, 0, 0]])
    return np.hstack([between, (1.0 + RATIO) * cart])


SCALES = (
    Case(
        "stiff rod", "A01 on a spring of 1e9 N/m", "3e4 rad/s beside 3 rad/s, and no damping",
        scenes.stiff_rod, 1.0, 0.05, at_all_instants(first_body, references.pendulum),
        "e of place and velocity, 20 instants (the stretch is 3e-8 m)",
        "A01 by elliptic functions",
        (*EXPLICIT, Try("adams", why=FAST_SPRING), Try("radau")),
        "tests/verification/test_implicit.py",
        floor=1e-6,  # the stretch
    ),
    Case(
        "stiff contact", "a ball on ground of 1e9 N/m",
        "between flights of 0.86 s a contact of 1e-4 s and 1.3e5 m/s^2, which a step "
        "can pass over",
        scenes.stiff_bounce, 5.0, 0.05,
        at_all_instants(_height, partial(references.bounce, 1.0, K, DROP)),
        "e of height and velocity, 100 instants over 5 bounces",
        "parabolas and sines, joined at each touch",
        (*EXPLICIT, Try("radau"),
         Try("rk4", settings={"step": 1e-4}, why=AS_LONG)), HERE,
    ),
    Case(
        "heavy on light", "1e9 kg hanging on a rod of 1 kg",
        "masses 1 to 1e9 along a chain: pivots of the equations differ as much",
        scenes.heavy_bob, 5.0, 0.05, at_all_instants(_bob, _heavy_bob),
        "e of the bob's place and velocity, 100 instants",
        "the equation of the pendulum, DOP853 at 3e-14",
        (Try(), Try(settings=TIGHT), Try("dopri5"), Try("adams"),
         Try("radau"), Try("rk4", settings={"step": 1e-3}),
         Try(method="lsq", why=REGULARISED), Try(method="penalty", why=REGULARISED)), HERE,
    ),
    Case(
        "light on heavy", "1 kg hanging on a cart of 1e9 kg",
        "the cart moves by 1e-9 m, below any tolerance that the bob asks for",
        scenes.heavy_cart, 5.0, 0.05,
        at_all_instants(_on_cart, partial(references.on_a_cart, RATIO)),
        "e of the bob against the cart, and of the cart's motion times 1e9; 100 instants",
        "the equation of the angle, DOP853 at 3e-14",
        (*USUAL, Try(method="penalty", why=TOO_SOFT)), HERE,
    ),
    Case(
        "mm, g, ms", "A03 in other units",
        "numbers of 1e3 where there were 1: limits and tolerances that mean metres go wrong",
        scenes.squeezer_in_mm, 50.0, 0.5,
        against_digits("A03", ("rP.F1", "p.K1", "p.K3", "w.K1", "rP.E3"), (1e3, 1e3)),
        "e of points, orientations, spin at 10 and 50 ms", "the digits of A03, scaled",
        USUAL, HERE,
    ),
)  # fmt: skip
