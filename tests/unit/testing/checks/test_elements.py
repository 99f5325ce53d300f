"""An error planted in what has to do with states is found; the words name row and remedy.
As in test_checks.py the set of checks that fail is asserted whole."""

import random
import re

import pytest

from dap3d_core.interface import Body, Contact, Joint, Point, Vector, body, number, point, vector
from dap3d_core.kernels import add, cross, dot, eye, scale, sub
from dap3d_core.testing import checks_for
from dap3d_forces.maxwell import Maxwell

ZERO = (0.0, 0.0, 0.0)


class Upright(Maxwell):
    def rate(d, r_P_i, z, k, c, l0):
        return Maxwell.rate(d, z, k, c, l0) + 0.1 * r_P_i[2]


class Drifting(Maxwell):
    def rate(d, v_P_i, z, k, c, l0):
        return Maxwell.rate(d, z, k, c, l0) - 0.1 * v_P_i[0]


class Noisy(Maxwell):
    def rate(d, z, k, c, l0):
        return Maxwell.rate(d, z, k, c, l0) * random.random()


class Branching(Maxwell):
    def rate(d, z, k, c, l0):
        if z > 0.0:
            return Maxwell.rate(d, z, k, c, l0)
        return 0.0 * z


class HiddenState(Maxwell):
    """Its tangent by complex numbers lacks what it owes to z."""

    def rate(d, z, k, c, l0):
        return Maxwell.rate(d, getattr(z, "real"), k, c, l0)  # noqa: B009


class EnergyWithoutState(Maxwell):
    def energy(d, k, k_p, l0):
        return Maxwell.energy(d, 0.0, k, k_p, l0)


class NoReaction(Maxwell):
    def wrench(d, z, s_P_i, s_P_j, k, k_p, l0):
        on_i, (force, moment) = Maxwell.wrench(d, z, s_P_i, s_P_j, k, k_p, l0)
        return on_i, (scale(1.1, force), scale(1.1, moment))


class Fed(Joint):
    """A body that is fed along x by a state: C = x - z, z_dot = (target - z) / tau."""

    keyword, rows, states = "fed", 1, ("z",)
    body_i: Body = body()
    target: float = number()
    tau: float = number(positive=True)

    def rate(z, target, tau):
        return (target - z) / tau

    def C(r_i, z):
        return r_i[0] - z

    def J():
        return (eye(1.0)[0] + ZERO,)

    def nu(z, target, tau):
        return (target - z) / tau

    def gamma(z, target, tau):
        return -(target - z) / tau / tau


class NuWithoutRate(Fed):
    nu = None


class GammaWithoutRate(Fed):
    def gamma():
        return 0.0


class GammaOfOtherSign(Fed):
    def gamma(z, target, tau):
        return (target - z) / tau / tau


PLANTED = [
    (Upright, {"rate frame"}, "row 1 of rate notices where ground is: .* common rigid motion"),
    (Drifting, {"energy", "rate frame"}, "row 1 of rate notices .* common velocity"),
    (Noisy, {"purity"}, "rate is not pure: it uses random of the module random"),
    (Branching, {"plain"}, r"rate branches on a number \[.*\]; branch by where\("),
    (HiddenState, {"rate"}, "row 1 of rate has another tangent .* by state 1 is 0 by complex step"),
    (EnergyWithoutState, {"energy"}, "the force on body i along . and the energy disagree"),
    (NoReaction, {"action and reaction", "energy"}, "the forces on all bodies sum to"),
    (NuWithoutRate, {"nu"}, "nu is missing, and row 1 of C depends on time"),
    (GammaWithoutRate, {"gamma"}, "row 1 of gamma is wrong by .* time derivative of row 1 of nu"),
    (GammaOfOtherSign, {"gamma"}, "row 1 of gamma is wrong by"),
]  # fmt: skip


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("type_", "failing", "words"), PLANTED, ids=[type_.__name__ for type_, *_ in PLANTED]
)
def test_a_planted_error_is_found(type_, failing, words):
    """By the checks that are about it and no others."""
    outcomes = [check.run() for check in checks_for(type_) if check.name != "compiled"]
    said = "\n".join(str(o) for o in outcomes if not o.ok)
    assert {o.check for o in outcomes if not o.ok} == failing, said
    assert re.search(words, said, re.DOTALL), said


@pytest.mark.parametrize("type_", [Maxwell, Fed])
def test_what_is_right_passes(type_):
    """Of a force and of a joint whose position row names a state, with the kernels compiled."""
    assert all(check.run().ok for check in checks_for(type_))


def test_a_state_that_nothing_reads_is_noted():
    """A counter is allowed, and told."""

    class Counter(Maxwell):
        states = ("z", "time")

        def rate(d, z, k, c, l0):
            return Maxwell.rate(d, z, k, c, l0), 1.0

    (check,) = (c for c in checks_for(Counter) if c.name == "rate")
    outcome = check.run()
    assert outcome.ok
    assert "no kernel but rate reads the state time: it changes no motion" in outcome.notes


class Floor(Contact):
    """A ball on a plane of body j."""

    keyword = "test-floor-contact"
    P_i: Point = point()
    P_j: Point = point("ground.O")
    a_j: Vector = vector("ground.z")
    radius: float = number(0.1, unit="m", positive=True)

    def gap(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def at(r_P_i, a_j, radius):
        return sub(r_P_i, scale(radius, a_j))

    def normal(a_j):
        return a_j


def twice(r_P_i, r_P_j, a_j, radius):
    """A gap twice as wide."""
    return 2.0 * Floor.gap(r_P_i, r_P_j, a_j, radius)


def double(a_j):
    """A normal twice as long."""
    return scale(2.0, a_j)


def back(a_j):
    """A normal to the wrong side."""
    return scale(-1.0, a_j)


def beside(r_P_i, a_j, radius):
    """A point beside the line of the gap."""
    return add(r_P_i, scale(radius, cross(a_j, (0.6, 0.0, 0.8))))


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("planted", "found"),
    [
        ({}, set()),
        ({"gap": twice}, {"J", "gamma"}),
        ({"gap": twice, "normal": double}, {"normal"}),
        ({"normal": back}, {"J", "gamma"}),
        ({"at": beside}, {"J", "gamma"}),
    ],
    ids=["none", "gap", "length", "side", "point"],
)
def test_a_planted_mistake_of_a_contact_is_found(planted, found):
    wrong = type("Wrong", (Floor,), {"keyword": "test-wrong-contact", **planted})
    names = {"J", "gamma", "normal"}
    outcomes = {c.name: str(c.run()) for c in checks_for(wrong) if c.name in names}
    assert {name for name, words in outcomes.items() if "failed" in words} == found
