"""Errors planted in joints with unknowns are named; the motion of joint types in words."""

import pytest
from support.joint_types import (
    Between,
    OnGround,
    Parabola,
    PinInSlot,
    RepeatedRow,
    Rising,
    Shelf,
    TwoHinges,
    Upright,
)
from support.unknown_types import WITH_UNKNOWNS, OnCurve, RollingEllipsoid

import dap3d_core as dap
from dap3d_core.interface import Joint, Point, choice, examine, number, point
from dap3d_core.kernels import add, cos, cross, dot, eye, hstack, neg, rotate, scale, sin, skew, sub
from dap3d_core.testing import check_type
from dap3d_core.testing.kit import type_motions
from dap3d_forces.weight import Weight
from dap3d_joints.planar import Planar
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


ON_TIME = "rows stay: its rows depend on time"
ONE_ROW = "rows stay: its 1 row costs less than 5 joint coordinates"
ON_VELOCITY = "rows stay: it has rows of the velocity level"
INSTALLED = {
    "rev": ["1 rotation about a_j, constant in body j"],
    "sph": ["3 rotations about P_j, constant in body j"],
    "cyl": ["1 translation along a_j and 1 rotation about a_j, constant in body j"],
    "tran": ["1 translation along a_j, constant in body j"],
    "univ": [
        "1 rotation about n_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ],
    "fix": ["none: the bodies move as one"],
    "weld": ["none: the bodies move as one"],
    "screw": ["1 screw about a_j, constant in body j"],
    "sph-sph": [ONE_ROW, ON_TIME, ON_VELOCITY],  # a link, a driven leg, one with an input
    "rP": [ONE_ROW, ON_VELOCITY],
    "disk": [ON_VELOCITY, ONE_ROW, ON_VELOCITY, ON_VELOCITY],
    "drive-rot": [ON_TIME, ON_VELOCITY],
    "drive-tran": [ON_TIME, ON_VELOCITY],
    "rel-rot": [ON_VELOCITY, ON_VELOCITY],
    "rel-tran": [ON_VELOCITY, ON_VELOCITY],
    "planar": ["2 translations along n_j and m_j and 1 rotation about a_j, constant in body j"],
    "parallel": ["rows stay: its 2 rows cost less than 4 joint coordinates"],
    "inline": ["rows stay: its 2 rows cost less than 4 joint coordinates"],
    "inplane": [ONE_ROW],
    "oncurve": ["rows stay: it has unknowns of its own: s"] * 2,
    "cv": ["rows stay: the axes of its free motions are constant in neither body"],
    "motor": [ON_TIME, *[ON_VELOCITY] * 2, ON_TIME, *[ON_VELOCITY] * 2],
    "couple": ["rows stay: it joins three bodies"],
    "gear": [ONE_ROW] * 2,
    "rack": [ONE_ROW],
    "belt": ["rows stay: it joins three bodies"],
    "cable": ["rows stay: it joins three bodies"] * 4 + [ON_TIME] * 2,  # two lists each
    "tendon": ["rows stay: it joins three bodies"] * 2,
    "follow": ["rows stay: it joins three bodies"] * 4,
    "point-on-plane": [ONE_ROW],
    "point-on-surface": [ONE_ROW],
}


class Undefined(Joint):
    """Its rows are not numbers where C would be zero."""

    keyword, rows = "undefined", 3
    P_i: Point = point()
    P_j: Point = point()

    def C(r_P_i, r_P_j):
        return tuple(x / (x * x) for x in sub(r_P_i, r_P_j))


class Either(Between):
    """A ball on a plane, or in a socket: a field says which."""

    keyword, rows = "either", 3
    held: str = choice(("plane", "socket"))

    def prepare(self, bodies):
        return super().prepare(bodies) | {"socket": float(self.held == "socket")}

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j, socket):
        d = sub(r_P_i, r_P_j)
        plane = (dot(a_j, d), dot(a_i, n_j), dot(a_i, m_j))
        return tuple(socket * x + (1.0 - socket) * y for x, y in zip(d, plane, strict=True))


OWN = {
    PinInSlot: (
        "1 translation along a_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ),
    TwoHinges: (
        "1 rotation about a_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ),
    OnGround: "1 rotation about a_i, constant in body i",
    Shelf: "1 translation along (1, 0, 0), constant in ground",
    Parabola: "rows stay: the axes of its free motions are constant in neither body",
    RepeatedRow: "rows stay: its rows depend on each other where C = 0",
    Upright: "rows stay: its rows depend on where ground is",
    Rising: ON_TIME,
    Undefined: "rows stay: no pose with C = 0 was found from the one given",
    Either: "rows stay: its motion is another for other values of its fields",
}


def test_every_installed_joint_is_in_the_list():
    assert set(INSTALLED) == set(dap.load_registry().keywords("joint"))


@pytest.mark.every(5)
@pytest.mark.parametrize("keyword", INSTALLED)
def test_motion_of_installed_types(keyword):
    motions = type_motions(dap.load_registry().get("joint", keyword))
    assert [motion.words for motion in motions] == INSTALLED[keyword]
    assert [motion.parts is None for motion in motions] == [
        words.startswith("rows stay") for words in INSTALLED[keyword]
    ]


@pytest.mark.every(3)
@pytest.mark.parametrize("type_", OWN, ids=lambda type_: type_.keyword)
def test_motion_of_types_of_authors(type_):
    (motion,) = type_motions(examine(type_))
    assert motion.words == OWN[type_]


def test_the_report_has_the_motion_of_a_joint_alone():
    assert "motion: 2 translations along n_j and m_j" in str(check_type(Planar, poses=1))
    assert check_type(Weight, poses=1).motions == ()
