"""An error planted in each formula of a jump is found, by the check that is for it.
Each type is a stop with one formula spoiled, or breaks one rule of a type. The set of checks that
fail is asserted whole: what is right stays right."""

import pytest
from support.jumping import Bounce, Clutch, Stage
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.interface import Force, Point, Vector, examine, number, point, vector
from dap3d_core.kernels import cross, neg, scale, where
from dap3d_core.testing import check_type
from dap3d_forces.plane_stop import PlaneStop
from dap3d_forces.point_to_point_stop import PointToPointStop
from dap3d_forces.rotation_stop import RotationStop

ZERO = (0.0, 0.0, 0.0)


class CreatesEnergy(PlaneStop):
    def impulse(Jv, e):
        return where(Jv < 0.0, -(2.0 + e) * Jv, 0.0)


class SquaresRestitution(PlaneStop):
    def impulse(Jv, e):
        return where(Jv < 0.0, -(1.0 + e * e) * Jv, 0.0)


class ActsOnWhatParts(PlaneStop):
    unilateral = ()

    def impulse(Jv, e):
        return -(1.0 + e) * Jv


class Pulls(PlaneStop):
    restitution = ""

    def impulse(Jv):
        return -Jv


class Restless(PlaneStop):
    restitution = ""

    def impulse(Jv):
        return where(Jv < 0.0, -0.5 * Jv, 0.0)


class NoArm(PlaneStop):
    def J(a_j, r_P_i, r_j):
        back = neg(a_j)
        return ((*a_j, *ZERO),), ((*back, *cross((0.0, 0.0, 0.0), back)),)


class WrongSide(PointToPointStop):
    def J(d, s_P_i, s_P_j, way):
        one, other = PointToPointStop.J(d, s_P_i, s_P_j, way)
        return tuple(map(neg_row, one)), tuple(map(neg_row, other))


def neg_row(row):
    return tuple(-x for x in row)


class NoReaction(RotationStop):
    def J(axis, way):
        return ((*ZERO, *ZERO),), ((*ZERO, *scale(way, axis)),)

    def impulse(Jv, e):  # without a least speed: at all samples that approach
        return where(Jv < 0.0, -(1.0 + e) * Jv, 0.0)


class GroundAxes(Clutch):
    def J():
        return ((*ZERO, 0.0, 0.0, -1.0),), ((*ZERO, 0.0, 0.0, 1.0),)


class ImpulseWithoutReaction(Force):
    """Two bodies are pushed apart, one of them only."""

    keyword = "separation"
    P_i: Point = point()
    P_j: Point = point()
    d_i: Vector = vector()
    t_on: float = number()

    def switch(t, t_on):
        return t - t_on

    def impulse(s_P_i, d_i):
        return (d_i, cross(s_P_i, d_i)), (ZERO, ZERO)


class ImpulseInGroundAxes(ImpulseWithoutReaction):
    def impulse(s_P_i, s_P_j):
        P = (0.0, 0.0, 1.0)
        return (P, cross(s_P_i, P)), (neg(P), neg(cross(s_P_j, P)))


class Branches(PlaneStop):
    def impulse(Jv, e):
        return -(1.0 + e) * Jv if Jv < 0.0 else 0.0


@pytest.mark.slow
@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("type_", "failing", "words"),
    [
        (CreatesEnergy, {"restitution"}, "impulse creates energy"),
        (SquaresRestitution, {"restitution"}, "impulse does not follow e ="),
        (ActsOnWhatParts, {"restitution", "round"}, "impulse acts on what parts"),
        (Pulls, {"unilateral"}, "it would have to pull"),
        (Restless, {"round"}, "impulse does not come to rest"),
        (NoArm, {"jump rows", "jump frame", "impulse and reaction"}, "J and switch disagree"),
        (WrongSide, {"jump rows"}, "J and switch disagree"),
        (NoReaction, {"jump frame", "impulse and reaction"}, "has no reaction"),
        (GroundAxes, {"jump frame"}, "of J notices where ground is"),
        (ImpulseWithoutReaction, {"impulse and reaction"}, "impulse has no reaction"),
        (ImpulseInGroundAxes, {"jump frame", "impulse and reaction"}, "notices where ground is"),
        (Branches, {"plain", "compiled"}, "branches on a number"),
    ],
    ids=lambda v: v.__name__ if isinstance(v, type) else "",
)
def test_a_planted_error_is_found_and_named(type_, failing, words):
    """In two poses; that a body is moved without reaction shows where bodies approach."""
    report = check_type(type_, poses=4 if type_ is NoReaction else 2)
    failing -= set() if jit_is_on() else {"compiled"}
    assert {outcome.check for outcome in report.outcomes if not outcome.ok} == failing
    assert any(words in finding.words for finding in report.findings), str(report)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "type_",
    [Bounce, Clutch, Stage],  # those of plugins: tests/contract
)
def test_right_jumps_pass(type_):
    report = check_type(type_, poses=2)
    assert report.ok, str(report)


def stop(**members):
    """A stop with other members."""
    return type(Force)("Mine", (PlaneStop,), {"keyword": "mine", **members})


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"impulse": lambda Jv, e: (Jv, e)}, "it should return 1 numbers, the change of J v"),
        ({"J": lambda a_j: ((1.0, 2.0, 3.0),)}, "a block of rows x 6"),
        ({"switch": None}, "define switch"),
        ({"impulse": None}, "defines J without impulse"),
        ({"unilateral": (1,)}, "unilateral names rows of J, 0 to 0"),
        ({"restitution": "elasticity"}, "restitution = 'elasticity' is the field of a number"),
        ({"impulse": lambda Jw: Jw}, "asks for Jw, which its fields do not offer"),
        ({"J": None, "switch": lambda v_P_i: v_P_i[2]}, "write J by hand"),
        ({"reset": lambda e: e}, "defines reset, but no states"),
        ({"inpulse": lambda Jv: Jv}, "did you mean impulse"),
    ],
)
def test_a_type_that_breaks_a_rule_of_jumps_is_refused(members, words):
    with pytest.raises(dap.PluginError) as error:
        examine(stop(**members))
    assert words in str(error.value)
