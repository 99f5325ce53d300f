"""An error planted in each kind of formula is found, and the words name row and remedy.
Each type here is a standard type with one formula spoiled, or a small type that breaks one rule.
The set of checks that fail is asserted whole: what is right stays right."""

import inspect
import math
import random
import re
import sys

import pytest
from scipy.special import jv
from support.plain import jit_is_on

from dap3d_core.interface import (
    REQUIRED,
    Body,
    Force,
    Joint,
    Point,
    Vector,
    Vector2,
    body,
    function,
    number,
    point,
    vector,
    vector2,
)
from dap3d_core.kernels import (
    add,
    atan2,
    cross,
    dot,
    eye,
    hstack,
    neg,
    row,
    scale,
    sign,
    skew,
    sqrt,
    sub,
    where,
)
from dap3d_core.testing import check_type, checks_for
from dap3d_forces.point_to_point import PointToPoint, pull
from dap3d_functions.harmonic import Harmonic
from dap3d_joints.disk import Disk
from dap3d_joints.driven_translation import DrivenTranslation
from dap3d_joints.point_on_plane import PointOnPlane
from dap3d_joints.revolute import Revolute
from dap3d_joints.spherical import Spherical

ZERO = (0.0, 0.0, 0.0)
CALLS: list[float] = []
LIMITS = {"k": 2.0}


class WrongC(Spherical):
    def C(r_P_i, r_P_j):
        x, y, z = sub(r_P_j, r_P_i)
        return x, y, z + 0.1 * x * x


class WrongSignInJ(Spherical):
    def J(s_P_i, s_P_j):
        return hstack(eye(-1.0), skew(s_P_i)), hstack(eye(1.0), skew(s_P_j))


class ManualRevolute(Revolute):
    """The manual's rows 4 and 5, with a_j for a_i: right on the constraints alone."""

    def J(s_P_i, s_P_j, a_j, n_j, m_j):
        n, m = cross(a_j, n_j), cross(a_j, m_j)
        return (
            (*hstack(eye(-1.0), skew(s_P_i)), row(ZERO, n), row(ZERO, m)),
            (*hstack(eye(1.0), skew(neg(s_P_j))), row(ZERO, neg(n)), row(ZERO, neg(m))),
        )

    def gamma(s_P_i, s_P_j, a_j, n_j, m_j, a_j_dot, n_j_dot, m_j_dot, w_i, w_j):
        w = sub(w_j, w_i)
        n_dot = add(cross(a_j_dot, n_j), cross(a_j, n_j_dot))
        m_dot = add(cross(a_j_dot, m_j), cross(a_j, m_j_dot))
        point_rows = sub(cross(w_i, cross(w_i, s_P_i)), cross(w_j, cross(w_j, s_P_j)))
        return (*point_rows, dot(n_dot, w), dot(m_dot, w))


class TermMissingInGamma(Revolute):
    def gamma(s_P_i, s_P_j, a_i, n_j, m_j, a_i_dot, m_j_dot, w_i, w_j):
        w = sub(w_j, w_i)
        n_dot = cross(a_i_dot, n_j)
        m_dot = add(cross(a_i_dot, m_j), cross(a_i, m_j_dot))
        point_rows = sub(cross(w_i, cross(w_i, s_P_i)), cross(w_j, cross(w_j, s_P_j)))
        return (*point_rows, dot(n_dot, w), dot(m_dot, w))


class NuMissing(PointOnPlane):
    nu = None


class DriveMissingInGamma(DrivenTranslation):
    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j):
        d, d_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        slide = sub(add(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
        return dot(cross(w_i, s_P_i_dot), a_j) + dot(slide, a_j_dot)


class OneVariantWrong(Disk):
    variants = Disk.variants

    def gamma(A_i, w_i, radius):
        return 0.0, 0.0, 0.0


class RowTwice(Joint):
    keyword, rows = "row-twice", 2
    P_i: Point = point()
    P_j: Point = point()
    a_j: Vector = vector()

    def C(r_P_i, r_P_j, a_j):
        x = dot(a_j, sub(r_P_j, r_P_i))
        return x, 2.0 * x

    def J(s_P_i, r_P_i, r_j, a_j):
        arm = sub(r_P_i, r_j)
        i, j = row(neg(a_j), neg(cross(s_P_i, a_j))), row(a_j, cross(arm, a_j))
        return (i, tuple(2.0 * x for x in i)), (j, tuple(2.0 * x for x in j))

    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j):
        d, d_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        slide = sub(add(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
        x = dot(cross(w_i, s_P_i_dot), a_j) + dot(slide, a_j_dot)
        return x, 2.0 * x


class Contradiction(RowTwice):
    keyword = "contradiction"

    def C(r_P_i, r_P_j, a_j):
        x = dot(a_j, sub(r_P_j, r_P_i))
        return x, 2.0 * x + 1.0


class Upright(Joint):
    """A vector of body i stays level, though two bodies are named."""

    keyword, rows = "upright", 1
    body_j: Body = body()
    a_i: Vector = vector()

    def C(a_i):
        return a_i[2]

    def J(a_i):
        return row(ZERO, cross(a_i, (0.0, 0.0, 1.0))), row(ZERO, ZERO)

    def gamma(a_i_dot, w_i):
        return -cross(w_i, a_i_dot)[2]


class Square(Joint):
    """P_i stays in a plane, said by the square of its distance: no force keeps it there."""

    keyword, rows = "square", 1
    P_i: Point = point()
    P_j: Point = point()
    a_j: Vector = vector()

    def C(r_P_i, r_P_j, a_j):
        x = dot(a_j, sub(r_P_j, r_P_i))
        return x * x


class TouchingLine(Square):
    """A plane, and a surface that touches it: their normals are one where both hold."""

    keyword, rows = "touching", 2
    b_j: Vector = vector()

    def C(r_P_i, r_P_j, a_j, b_j):
        d = sub(r_P_j, r_P_i)
        x, y = dot(a_j, d), dot(b_j, d)
        return x, x + y * y


class WrongSignBesideForm(Joint):
    """P_i does not move along a_j as seen from P_j; gamma is derived from that, and right."""

    keyword, rows, holonomic = "wrong-sign-beside-form", 1, False
    P_i: Point = point()
    P_j: Point = point()
    a_j: Vector = vector()

    def C_dot(v_P_i, v_P_j, a_j):
        return dot(a_j, sub(v_P_i, v_P_j))

    def J(s_P_i, s_P_j, a_j):
        return row(a_j, neg(cross(s_P_i, a_j))), row(neg(a_j), neg(cross(s_P_j, a_j)))


class NoReaction(PointToPoint):
    variants = ()

    def wrench(d, s_P_i, s_P_j, k, l0):
        length = sqrt(dot(d, d))
        on_i, _ = pull(k * (length - l0), scale(1.0 / length, d), s_P_i, s_P_j)
        return on_i, (neg(on_i[0]), neg(on_i[1]))


class TwiceTheEnergy(PointToPoint):
    variants = ()

    def energy(d, k, l0, f_a):
        length = sqrt(dot(d, d))
        return k * (length - l0) * (length - l0) + f_a * length


class Drag(Force):
    """Against the velocity of body i over ground, though two bodies are named."""

    keyword = "drag"
    P_i: Point = point()
    P_j: Point = point()
    c: float = number()

    def wrench(v_P_i, s_P_i, s_P_j, r_P_i, r_P_j, c):
        F = scale(-c, v_P_i)
        arm = add(s_P_j, sub(r_P_i, r_P_j))
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(arm, F)))


class Driving(Spherical):
    def friction(lam, mu, w_i, w_j):
        moment = scale(mu * lam[0], sub(w_i, w_j))
        return (ZERO, moment), (ZERO, neg(moment))


class Spring(Force):
    keyword = "spring"
    d: Vector2 = vector2()
    k: float = number()


class Noisy(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        return pull(k + random.random(), d, s_P_i, s_P_j)


class Counting(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        CALLS.append(k)
        return pull(k + len(CALLS), d, s_P_i, s_P_j)


class ReadingTable(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        return pull(k + LIMITS["k"], d, s_P_i, s_P_j)


class NoisyPrepare(Spring):
    def prepare(self, bodies):
        return {"noise": random.random()}

    def wrench(d, k, noise, s_P_i, s_P_j):
        return pull(k * noise, d, s_P_i, s_P_j)


class Printing(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        print("the stiffness is", k)
        return pull(k, d, s_P_i, s_P_j)


class Branching(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        length = dot(d, d)
        if length > 1.0:
            k = 2.0 * k
        return pull(k, d, s_P_i, s_P_j)


class Signed(Spring):
    """Pulls as its points part, with one force."""

    def wrench(d, v_P_i, v_P_j, k, s_P_i, s_P_j):
        return pull(k * sign(dot(d, sub(v_P_j, v_P_i))), d, s_P_i, s_P_j)


class Limited(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        inside = (dot(d, d) < 1.0) & (k > 0.5)
        stiffness = where(inside, k, 0.5 * k)
        return pull(min(stiffness, 1.0), d, s_P_i, s_P_j)


class MathExp(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        fading = math.exp(-dot(d, d))
        return pull(k * fading, d, s_P_i, s_P_j)


class Bessel(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        return pull(k * jv(0, dot(d, d)), d, s_P_i, s_P_j)


class MathSqrt(PointToPoint):
    """Right but for its energy, with a square root that takes no complex numbers."""

    variants = ()

    def energy(d, k, l0):
        length = math.sqrt(dot(d, d))
        return 0.5 * k * (length - l0) * (length - l0)


def wrong_derivative(order):
    """Harmonic with one of its derivatives ten percent too large."""

    class Wrong(Harmonic):
        def value(x, amplitude, frequency, phase, offset):
            found = Harmonic.value(x, amplitude, frequency, phase, offset)
            return tuple(1.1 * f if k == order else f for k, f in enumerate(found))

    return Wrong


PLANTED = [
    (WrongC, {"J", "gamma"}, "row 3 of gamma .* second time derivative of row 3 of C"),
    (WrongSignInJ, {"J", "virtual power", "action and reaction"},
     r"column \d of body j, .* the derivative of row 1 of C by a turn of body j about [yz]"),
    (ManualRevolute, {"J", "gamma", "virtual power"}, "row 4 of J is wrong by"),
    (TermMissingInGamma, {"gamma"},
     "row 4 of gamma is wrong by .* minus the time derivative of row 4 of J, times v"),
    (NuMissing, {"nu"}, "nu is missing, and row 1 of C depends on time"),
    (DriveMissingInGamma, {"gamma"}, "the time derivative of row 1 of nu less that of row 1 of J"),
    (OneVariantWrong, {"gamma"}, r"failed: gamma \[slip = xyz\]"),
    (RowTwice, {"rank"}, "the rank of J is 1 at best, and 2 rows are declared: row 2 follows"),
    (Contradiction, {"assembly"}, "no pose with C = 0 was found"),
    (WrongSignBesideForm, {"velocity form"}, "row 1 of J and nu is not the form C_dot"),
    (Square, {"rank"}, "the rank of J is 0 at best, .* where C = 0 the gradient of row 1 vanishes"),
    (TouchingLine, {"rank"}, "where C = 0 .* row 2 .* though elsewhere the rank is 2"),
    (Upright, {"frame", "action and reaction"}, "row 1 of C notices where ground is"),
    (NoReaction, {"energy", "action and reaction"},
     "the moments about the origin on all bodies sum to"),
    (TwiceTheEnergy, {"energy"}, "the force on body i along x and the energy disagree by"),
    (Drag, {"frame"}, "after a common velocity of all bodies the (force|moment) on body i"),
    (Driving, {"friction power"}, "friction drives: its power is"),
    (Noisy, {"purity"}, "it uses random of the module random"),
    (Counting, {"purity"}, "row 1 of wrench gives other numbers when it is called again"),
    (ReadingTable, {"purity"}, "it reads LIMITS, a dict that anyone may change; make it a tuple"),
    (Printing, {"purity"}, r"prints? is not shown: 'the stiffness is .*it calls print\(\)"),
    (Branching, {"plain", "branches"}, r"wrench branches on a number \[.*\]; branch by where\("),
    (Limited, {"plain", "branches"}, r"wrench branches on a number \[.*min or max"),
    (Signed, {"branches"}, "wrench jumps by .* no switch is defined"),
    (MathExp, {"plain"},
     r"wrench takes floats alone \(TypeError: .*\) \[.*take .*sqrt, .*not from math"),
    (Bessel, {"plain"}, r"wrench takes floats alone \(a function of numpy or scipy\) \["),
    (NoisyPrepare, {"purity"}, "prepare returns other numbers"),
    (MathSqrt, {"energy", "plain"}, r"energy does not run on complex numbers .* differences alone"),
    (wrong_derivative(1), {"derivatives"}, "f' is wrong by .* the derivative of f "),
    (wrong_derivative(3), {"derivatives"}, "f''' is wrong by .* the derivative of f'' "),
]  # fmt: skip


@pytest.mark.every(15)
@pytest.mark.parametrize(
    ("type_", "failing", "words"),
    PLANTED,
    ids=[f"{k}-{p[0].__name__}" for k, p in enumerate(PLANTED)],
)
def test_a_planted_error_is_found(type_, failing, words):
    """By the checks that are about it and no others, in words that name row and remedy."""
    outcomes = [check.run() for check in checks_for(type_, poses=2) if check.name != "compiled"]
    assert {o.check for o in outcomes if not o.ok} == failing
    said = "\n".join(str(o) for o in outcomes if not o.ok)
    assert re.search(words, said, re.DOTALL), said


@pytest.mark.parametrize(
    ("type_", "line"), [(Branching, 2), (Limited, 3), (MathExp, 1), (Bessel, 1)]
)
def test_what_is_not_plain_is_told_at_its_line(type_, line):
    """Of the author's file."""
    _, first = inspect.getsourcelines(type_.wrench)
    (check,) = (c for c in checks_for(type_, poses=1) if c.name == "plain")
    assert f" [{__file__}:{first + line}]; " in str(check.run())


def test_what_a_kernel_prints_while_it_is_checked_is_not_shown(capsys):
    """It is called hundreds of times."""
    checks = checks_for(Printing, poses=1)
    capsys.readouterr()
    for check in checks:
        check.run()
    assert capsys.readouterr().out == ""


def test_of_a_kernel_that_gives_other_numbers_each_time_nothing_else_is_judged():
    """What formulas give by chance is neither right nor wrong."""
    outcomes = {o.check: o for o in check_type(Noisy, poses=2).outcomes}
    assert outcomes.pop("purity").state == "failed"
    assert {o.state for o in outcomes.values()} == {"not applicable"}
    assert "other numbers each time" in outcomes["action and reaction"].words


@pytest.mark.slow
def test_gamma_beside_a_wrong_J_is_compared_with_C():
    """Right or wrong, and the outcome says so; wrong by a known number."""
    gamma = {o.check: o for o in check_type(WrongSignInJ, poses=2).outcomes}["gamma"]
    assert gamma.ok
    assert any(n.startswith("row 1 of J or nu is not what C says") for n in gamma.notes)

    class BothWrong(WrongSignInJ):
        def gamma(s_P_i, s_P_j, w_i, w_j):
            a, b, c = Spherical.gamma(s_P_i, s_P_j, w_i, w_j)
            return a, b + 0.25, c

    (finding,) = (f for f in check_type(BothWrong, poses=2).findings if f.check == "gamma")
    assert (finding.row, finding.error) == (2, pytest.approx(0.25, rel=1e-6))


class Cam(Joint):
    """A follower P_i on a plate cam j: its distance from P_j is a function of its angle."""

    keyword, rows = "cam", 1
    P_i: Point = point()
    P_j: Point = point()
    a_j: Vector = vector()
    x_j: Vector = vector(across="a_j")
    profile: str = function(REQUIRED, argument="the polar angle, rad")

    def C(r_P_i, r_P_j, a_j, x_j, profile):
        d = sub(r_P_i, r_P_j)
        x, y = dot(x_j, d), dot(cross(a_j, x_j), d)
        return sqrt(x * x + y * y) - profile(atan2(y, x))


def test_a_function_that_is_always_there_is_given_to_the_type_itself():
    """No variant is told from another by it."""
    report = check_type(Cam, poses=1)
    assert report.ok, str(report)
    assert {o.state for o in report.outcomes if o.check in ("J", "gamma", "rank")} == {"ok"}


FACTOR = 1.0


class Frozen(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        return pull(FACTOR * k, d, s_P_i, s_P_j)


class NotPlain(Spring):
    def wrench(d, k, s_P_i, s_P_j):
        return pull(max(k, 0.0), d, s_P_i, s_P_j)


compiling = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


@compiling
def test_numbers_that_compiling_changes_are_found(monkeypatch):
    """A constant of a module is frozen when it is compiled; plain Python sees the new one."""
    (check,) = (c for c in checks_for(Frozen) if c.name == "compiled")
    check()
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 2.0)
    outcome = check.run()
    assert re.search(r"row 1 of wrench is .* compiled and .* in plain Python", str(outcome))


@compiling
def test_what_cannot_be_compiled_is_said():
    (check,) = (c for c in checks_for(NotPlain) if c.name == "compiled")
    with pytest.raises(AssertionError, match="the kernels of its loop cannot be compiled"):
        check()


@pytest.mark.slow
def test_a_report_has_all_that_is_needed_to_see_the_error_again():
    """Seed, pose, fields; the same seed leads to the same numbers, another one to others."""
    report, again, other = (check_type(TermMissingInGamma, poses=1, seed=s) for s in (7, 7, 8))
    (finding,) = (f for f in report.findings if f.check == "gamma")
    assert (finding.kernel, finding.row, finding.variant) == ("gamma", 4, "")
    assert finding.error > finding.tolerance > 0.0
    assert finding.pose["seed"] == 7
    assert finding.pose.keys() >= {"pose", "t", "r_i", "p_i", "v_i", "w_j", "P_i", "a_i"}
    assert [str(f) for f in again.findings] == [str(f) for f in report.findings]
    assert str(other.findings[0]) != str(finding)
    assert not report.ok


@pytest.mark.slow
def test_each_variant_is_checked_by_itself():
    """The words name the variant that is wrong; the others are right."""
    report = check_type(OneVariantWrong, poses=1)
    assert {f.variant for f in report.findings} == {"slip = xyz"}
    assert {o.variant for o in report.outcomes} == {f"slip = {s}" for s in ("z", "nz", "tz", "xyz")}


def test_a_kernel_that_fails_on_some_input_is_a_finding():
    """What a kernel raises is told."""

    class Fails(PointOnPlane):
        def gamma(a_j, w_i, s_P_i_dot, f_ddot, t):
            if t < 0.4:  # not where the type is examined
                raise LookupError("no such thing")
            return PointOnPlane.gamma(a_j, w_i, s_P_i_dot, f_ddot)

    report = check_type(Fails, poses=2)
    assert "it could not be carried out: LookupError: no such thing" in str(report)


@pytest.mark.slow
def test_a_type_without_a_finite_number_is_told():
    """It was finite where the type was examined, at other times."""

    class Nowhere(Spring):
        def wrench(d, k, s_P_i, s_P_j, t):
            return pull(k, scale(where(t < 1.05, math.nan, 1.0), d), s_P_i, s_P_j)

    (check,) = (c for c in checks_for(Nowhere, poses=1) if c.name == "frame")
    outcome = check.run()
    assert "200 random elements in a row: its kernels give no finite numbers" in str(outcome)
    assert not outcome.ok


def test_a_declared_exemption_is_told():
    """A type that uses the axes of ground, or has an energy of limited range, says so."""

    class Level(Upright):
        ground_axes = True

    outcomes = {o.check: o for o in check_type(Level, poses=1).outcomes}
    assert outcomes["frame"].state == outcomes["action and reaction"].state == "not applicable"
    assert "ground_axes = True" in outcomes["frame"].words

    class Limited(TwiceTheEnergy):
        energy_where = "where the spring is slack"

    outcomes = {o.check: o for o in check_type(Limited, poses=1).outcomes}
    assert outcomes["energy"].words.endswith("only where the spring is slack")
