"""Errors planted in joints with unknowns are named: by check-plugin, or where a type is loaded."""

import pytest
from support.unknown_types import WITH_UNKNOWNS, OnCurve, RollingEllipsoid

import dap3d_core as dap
from dap3d_core.interface import examine, number
from dap3d_core.kernels import add, cos, cross, eye, hstack, neg, rotate, scale, sin, skew, sub
from dap3d_core.testing import check_type
from dap3d_joints.spherical import Spherical


def failures(type_):
    outcomes = check_type(type_, poses=4).outcomes
    return {o.check: "\n".join(map(str, o.findings)) for o in outcomes if not o.ok}


@pytest.mark.slow
@pytest.mark.every(4)
@pytest.mark.parametrize("type_", WITH_UNKNOWNS, ids=lambda t: t.keyword)
def test_joints_that_are_right_pass(type_):
    """Derived J, gamma, nu and G agree with C."""
    assert not failures(type_)


class ByHand(OnCurve):
    """All formulas written by hand: c and its derivatives turn with body j."""

    keyword = "by-hand"

    def J(s_P_i, s_P_j, A_j, s, a, b, h):
        arm = add(s_P_j, rotate(A_j, (a * cos(s), b * sin(s), h * sin(2.0 * s))))
        return hstack(eye(1.0), skew(neg(s_P_i))), hstack(eye(-1.0), skew(arm))

    def G(A_j, s, a, b, h):
        c_1 = (-a * sin(s), b * cos(s), 2.0 * h * cos(2.0 * s))
        return tuple((-x,) for x in rotate(A_j, c_1))

    def gamma(s_P_i, s_P_j, A_j, w_i, w_j, s, s_dot, a, b, h):
        arm = add(s_P_j, rotate(A_j, (a * cos(s), b * sin(s), h * sin(2.0 * s))))
        c_1 = rotate(A_j, (-a * sin(s), b * cos(s), 2.0 * h * cos(2.0 * s)))
        c_2 = rotate(A_j, (-a * cos(s), -b * sin(s), -4.0 * h * sin(2.0 * s)))
        own = add(scale(2.0 * s_dot, cross(w_j, c_1)), scale(s_dot * s_dot, c_2))
        turning = sub(cross(w_j, cross(w_j, arm)), cross(w_i, cross(w_i, s_P_i)))
        return add(turning, own)


@pytest.mark.slow
def test_formulas_by_hand_pass():
    assert not failures(ByHand)


class WrongG(ByHand):
    def G(A_j, s, a, b, h):
        c_1 = (-a * sin(s), b * cos(s), h * cos(2.0 * s))  # the two of 2 s is missing
        return tuple((-x,) for x in rotate(A_j, c_1))


class SignOfG(ByHand):
    def G(A_j, s, a, b, h):
        return tuple((x,) for x in rotate(A_j, (-a * sin(s), b * cos(s), 2.0 * h * cos(2.0 * s))))


class NoCoriolis(ByHand):
    def gamma(s_P_i, s_P_j, A_j, w_i, w_j, s, s_dot, a, b, h):
        arm = add(s_P_j, rotate(A_j, (a * cos(s), b * sin(s), h * sin(2.0 * s))))
        c_2 = rotate(A_j, (-a * cos(s), -b * sin(s), -4.0 * h * sin(2.0 * s)))
        turning = sub(cross(w_j, cross(w_j, arm)), cross(w_i, cross(w_i, s_P_i)))
        return add(turning, scale(s_dot * s_dot, c_2))


class NoArm(ByHand):
    def J(s_P_i, s_P_j):
        return hstack(eye(1.0), skew(neg(s_P_i))), hstack(eye(-1.0), skew(s_P_j))


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("type_", "checks", "words"),
    [
        (WrongG, {"G"}, "by the unknown s"),
        (SignOfG, {"G"}, "by the unknown s"),
        (NoCoriolis, {"gamma"}, "of gamma is wrong"),
        (NoArm, {"J"}, "of J is wrong"),
    ],
    ids=lambda x: getattr(x, "__name__", None),
)
def test_an_error_is_found(type_, checks, words):
    """The check that should find it does, in words about it."""
    found = failures(type_)
    assert checks <= set(found)
    assert words in "\n".join(found[check] for check in checks)


def early(s, s_dot):
    return (s, s_dot, 0.0)


def without_s(r_P_i, r_P_j):
    return sub(r_P_i, r_P_j)


def rubs(lam, mu):
    return ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def short(s):
    return (s,), (s,)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"unknowns": (), "C": Spherical.C, "G": short}, "defines G, but no unknowns"),
        ({"C": early}, "a quantity of the velocity level"),
        ({"C": without_s}, "C does not name s"),
        ({"G": short}, "3 rows of the derivatives of C by its 1 unknowns"),
        ({"friction": rubs}, "unknowns and friction"),
        ({"unknowns": ("s", "a")}, "the unknown a would hide a field"),
        ({"unknowns": ("s", "u", "v", "x")}, "too few to find its 4"),
        ({"periodic": ("u",)}, "none of its unknowns"),
        ({"unknowns": ("two words",)}, "no name that a kernel can take"),
        ({"s_0": number(None), "__annotations__": {"s_0": float}}, "belongs to the unknown s"),
    ],
    ids=["none", "level", "unnamed", "G", "friction", "field", "many", "periodic", "name", "start"],
)
def test_a_type_with_impossible_unknowns_is_refused(members, words):
    """With the class, the unknown, and what to do."""
    type_ = type("Own", (OnCurve,), {"__module__": __name__, **members})
    with pytest.raises(dap.PluginError, match=words):
        examine(type_)


def test_rows_of_velocities_are_linear_in_them():
    """C_dot may name unknowns, and not their rates."""

    def C_dot(v_i, x_dot):
        return v_i[0] * x_dot, v_i[1]

    type_ = type("Own", (RollingEllipsoid,), {"__module__": __name__, "C_dot": C_dot})
    with pytest.raises(dap.PluginError, match="it names x_dot"):
        examine(type_)
