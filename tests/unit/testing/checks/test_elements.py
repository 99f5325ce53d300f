"""Errors planted in states, contacts and forces on reactions are found; the words name the remedy.

As in test_checks.py the set of checks that fail is asserted whole. Types that cannot be are refused
where they are loaded.
"""

import random
import re

import pytest
from support.on_reactions import ON_REACTIONS, ZERO, Brake, PinFriction, Tyre

import dap3d_core as dap
from dap3d_core.interface import (
    Body,
    Contact,
    Joint,
    Point,
    Vector,
    body,
    examine,
    joint,
    number,
    point,
    vector,
)
from dap3d_core.kernels import add, cross, dot, eye, neg, scale, sqrt, sub, tanh
from dap3d_core.testing import check_type, checks_for
from dap3d_forces.maxwell import Maxwell


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


@pytest.mark.every(9)
@pytest.mark.parametrize(
    ("type_", "failing", "words"), PLANTED, ids=[type_.__name__ for type_, *_ in PLANTED]
)
def test_a_planted_error_is_found(type_, failing, words):
    """By the checks that are about it and no others."""
    outcomes = [check.run() for check in checks_for(type_) if check.name != "compiled"]
    said = "\n".join(str(o) for o in outcomes if not o.ok)
    assert {o.check for o in outcomes if not o.ok} == failing, said
    assert re.search(words, said, re.DOTALL), said


@pytest.mark.every(2)
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


@pytest.mark.every(5)
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


def failures(type_):
    outcomes = check_type(type_).outcomes
    return {o.check: "\n".join(map(str, o.findings)) for o in outcomes if not o.ok}


@pytest.mark.parametrize("type_", ON_REACTIONS, ids=lambda t: t.keyword)
def test_forces_that_are_right_pass(type_):
    """But for those on ground axes, whose forces need not turn with the bodies."""
    assert not failures(type_)


class Unopposed(Brake):
    def wrench(a_i, w_i, w_j, force_shoe, mu, radius, w_tol):
        moment = scale(-mu * radius * sqrt(dot(force_shoe, force_shoe)), a_i)
        return (ZERO, moment), (ZERO, moment)


class GroundAxes(Brake):
    def wrench(a_i, w_i, w_j, force_shoe, mu, radius, w_tol):
        moment = scale(-mu * radius * force_shoe[0], a_i)  # x of ground, of whatever direction
        return (ZERO, moment), (ZERO, neg(moment))


class Unloaded(Brake):
    def wrench(a_i, w_i, w_j, force_shoe, mu, radius, w_tol):
        load = sqrt(dot(force_shoe, force_shoe))
        along = scale(1.0 / load, force_shoe)
        moment = scale(-mu * radius * dot(along, force_shoe), a_i)
        return (ZERO, moment), (ZERO, neg(moment))


class Branches(PinFriction):
    def wrench(a_j, w_i, w_j, lam_pin, mu, radius, v_tol):
        load = lam_pin[0] if lam_pin[0] > 0.0 else -lam_pin[0]
        moment = scale(-radius * mu * load * tanh(dot(a_j, sub(w_i, w_j))), a_j)
        return (ZERO, moment), (ZERO, neg(moment))


@pytest.mark.parametrize(
    ("type_", "check", "words"),
    [
        (Unopposed, "action and reaction", "moment"),
        (GroundAxes, "frame", "rigid motion"),
        (Unloaded, "unloaded", "divide by no load"),
        (Branches, "plain", "branches on a number"),
    ],
    ids=lambda x: getattr(x, "__name__", None),
)
def test_an_error_is_found(type_, check, words):
    """The check that should find it does, in words about it, and no other."""
    found = failures(type_)
    assert set(found) - {"compiled"} == {check}  # a branch does not compile either
    assert words in found[check]


def a_type(**members):
    return type("Own", (Tyre,), {"__module__": __name__, **members})


def too_long(lam_contact):
    return ((scale(lam_contact[1], (1.0, 0.0, 0.0)), ZERO),)


def too_early(lam_contact):
    return lam_contact[0]


def misspelt(lam_contakt):
    return ((scale(lam_contakt[0], (1.0, 0.0, 0.0)), ZERO),)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"wrench": too_long}, "tuple index out of range"),
        ({"energy": too_early}, "reactions are known to wrench"),
        ({"switch": too_early}, "reactions are known to wrench"),
        ({"wrench": misspelt}, "did you mean lam_contact"),
        (
            {"lam_contact": number(default=1.0), "__annotations__": {"lam_contact": float}},
            "the reaction of a joint",
        ),
        ({"contact": joint(rows=0), "__annotations__": {"contact": str}}, "take 1 or more"),
    ],
    ids=["row 2 of 1", "energy", "switch", "misspelt", "field", "no rows"],
)
def test_a_type_that_misuses_reactions_is_refused(members, words):
    """With the class, the kernel, and what to do."""
    with pytest.raises(dap.PluginError, match=words):
        examine(a_type(**members))
