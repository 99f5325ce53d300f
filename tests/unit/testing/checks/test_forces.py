"""Errors planted in forces on reactions are named: by check-plugin, or where a type is loaded."""

import pytest
from support.on_reactions import ON_REACTIONS, ZERO, Brake, PinFriction, Tyre

import dap3d_core as dap
from dap3d_core.interface import examine, joint, number
from dap3d_core.kernels import dot, neg, scale, sqrt, sub, tanh
from dap3d_core.testing import check_type


def failures(type_):
    return {
        o.check: "\n".join(map(str, o.findings)) for o in check_type(type_).outcomes if not o.ok
    }


@pytest.mark.parametrize("type_", ON_REACTIONS, ids=lambda t: t.keyword)
def test_forces_that_are_right_pass(type_):
    """But for those on ground axes, whose forces need not turn with the bodies."""
    assert not failures(type_)


class NoReaction(Brake):
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
        (NoReaction, "action and reaction", "moment"),
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
