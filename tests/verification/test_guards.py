"""Branches that guard a formula guard what is derived from it, and the derivatives of that.
Each type leaves a formula to be derived and guards it where it has no value by itself: a root, a
quotient, an angle, a power or a logarithm at zero, in one branch or nested ones, in helpers, by
==, ~ and &. Expected numbers are limits in closed form. Where a series stands for a function its
first term left out is below 1e-12 within the guard."""

import numpy as np
import pytest
from support.own_types import registry_of
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Function, Joint, Point, body, function, number, point
from dap3d_core.kernels import atan2, cos, log, norm2, scale, sin, sqrt, sub, where
from dap3d_core.testing import check_type

pytest.importorskip("sympy")

#: Plain Python raises where it divides by zero, also on the side of a branch that is not taken.
compiled_alone = pytest.mark.skipif(not jit_is_on(), reason="plain Python divides by no zero")

K = 100.0
ZERO = (0.0, 0.0, 0.0)


def sinc_guarded_inside(x2):
    """sin(x) / x of x^2; the root never sees zero."""
    small = x2 < 1e-4
    x = sqrt(where(small, 1.0, x2))
    return where(small, 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0), sin(x) / x)


def sinc_guarded_outside(x2):
    """The same; what is not chosen has no value at zero."""
    return where(x2 < 1e-4, 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0), sin(sqrt(x2)) / sqrt(x2))


class Inside(Force):
    """Energy k (1 - sinc r), by a helper with a guard of its own."""

    keyword = "guard-inside"
    P_i: Point = point()
    k: float = number(K)

    def energy(r_P_i, k):
        return k * (1.0 - sinc_guarded_inside(norm2(r_P_i)))


class Outside(Force):
    keyword = "guard-outside"
    P_i: Point = point()
    k: float = number(K)

    def energy(r_P_i, k):
        return k * (1.0 - sinc_guarded_outside(norm2(r_P_i)))


class Logarithm(Force):
    """Energy k r^4 log r^2, guarded by equality."""

    keyword = "guard-log"
    P_i: Point = point()
    k: float = number(K)

    def energy(r_P_i, k):
        n = norm2(r_P_i)
        return where(n == 0.0, 0.0, k * n * n * log(n))


class Polar(Force):
    """Energy k rho^3 (2 + cos phi), guards nested and negated: a power and an angle at zero."""

    keyword = "guard-polar"
    P_i: Point = point()
    k: float = number(K)

    def energy(r_P_i, k):
        x, y = r_P_i[0], r_P_i[1]
        n = x * x + y * y
        apart = ~(n < 1e-18)
        phi = where(apart & (n < 1e6), atan2(y, x), 0.0)
        return k * where(apart, where(n > 1e4, 0.0, n**1.5 * (2.0 + cos(phi))), 0.0)


def sinc_force(r):
    """-k d/dr (1 - sin r / r) along r: k (r cos r - sin r) / r^2, and -k r / 3 near zero."""
    r = np.asarray(r, dtype=float)
    size = np.linalg.norm(r)
    if size < 1e-2:
        return -K * r * (1.0 / 3.0 - size**2 / 30.0)  # the next term is r^4 / 840 of it
    return K * (size * np.cos(size) - np.sin(size)) / size**2 * r / size


def log_force(r):
    n = np.dot(r, r)
    return -K * (4.0 * n * np.log(n) + 2.0 * n) * np.asarray(r) if n else np.zeros(3)


def polar_force(r):
    x, y, _ = r
    rho = np.hypot(x, y)
    if rho == 0.0:
        return np.zeros(3)
    return -K * np.array([6.0 * rho * x + 3.0 * x * x + y * y, 6.0 * rho * y + 2.0 * x * y, 0.0])


FORCES = [
    (Inside, sinc_force), (Outside, sinc_force), (Logarithm, log_force), (Polar, polar_force)
]  # fmt: skip


def held_by(type_, r):
    scene = dap.Scene(name="guarded")
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.1, 0.1), r=r)
    scene.add_force(type_.keyword, "spring", P_i="b.O")
    return dap.compile(scene, registry=registry_of(type_))


@pytest.mark.parametrize(("type_", "force"), FORCES)
@pytest.mark.parametrize("r", [ZERO, (1e-3, 0.0, 0.0), (1e-7, -2e-7, 0.0), (0.3, -0.2, 0.4)])
def test_a_wrench_keeps_the_guards_of_its_energy(type_, force, r):
    """In the guarded point, near to it and far from it; rounding of some hundred operations."""
    compiled = held_by(type_, r)
    np.testing.assert_allclose(compiled.rhs(0.0, compiled.model.u0)[7:10], force(r),
                               rtol=1e-9, atol=1e-11)  # fmt: skip


@pytest.mark.parametrize("type_", [Inside, pytest.param(Outside, marks=compiled_alone)])
def test_guarded_points_are_linearised(type_):
    """w^2 = k / (3 m); at rest the equilibrium is the guarded point itself."""
    compiled = held_by(type_, ZERO)
    found = np.sort(np.abs(dap.linearize(compiled).eigenvalues.imag))[-6:]
    np.testing.assert_allclose(found, np.sqrt(K / 3.0), rtol=1e-9)
    rest = dap.equilibrium(compiled)
    np.testing.assert_allclose(rest.r, 0.0, atol=1e-12)


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_run_begins_at_a_guarded_point(integrator):
    """Thrown from it with 0.01 m/s: x = v / w sin(w t), as far as the spring is linear.
    Its cubic term shifts the frequency by 3/8 x^2 / 10, with x = 1.7 mm 1e-7 of the phase."""
    compiled = held_by(Outside, ZERO)
    scene = compiled.scene
    scene.bodies["b"].r_dot = (0.01, 0.0, 0.0)
    compiled = dap.compile(scene, registry=registry_of(Outside))
    result = dap.simulate(compiled, t_end=1.0, rtol=1e-9, integrator=integrator)
    w = np.sqrt(K / 3.0)
    np.testing.assert_allclose(
        result.r[:, 0, 0], 0.01 / w * np.sin(w * result.t), atol=1e-6 * 0.01 / w
    )


class Lock(Joint):
    """The rotation vector of body i is that about z which a function of time prescribes.
    2 atan2(|e|, e0) e / |e| of the Euler parameters, guarded at zero."""

    keyword, rows, ground_axes = "guarded-lock", 3, True
    body_i: Body = body()
    function: str = function()

    def C(p_i, f):
        e = (p_i[1], p_i[2], p_i[3])
        s = where(p_i[0] < 0.0, -1.0, 1.0)
        n2 = norm2(e)
        small = n2 < 1e-4
        n = sqrt(where(small, 1.0, n2))
        # atan2(n, e0) / n with e0 = sqrt(1 - n^2): asin(n) / n = 1 + n^2/6 + 3 n^4/40 + ...
        factor = where(small, 2.0 + n2 / 3.0 + 0.15 * n2 * n2, 2.0 * atan2(n, s * p_i[0]) / n)
        return sub(scale(s * factor, e), (0.0, 0.0, f))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 0.5])
def test_a_joint_keeps_the_guards_of_its_position(rate):
    """Identity is on the manifold: J is the identity there, and nu the prescribed rate.
    The body follows it through the guard and beyond, at 0.5 rad/s over one second."""
    scene = dap.Scene(name="locked")
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.2, 0.3), w=(0.0, 0.0, rate))
    scene.add_function("a", "turn", coeff=(0.0, rate, 0.0))
    scene.add_joint("guarded-lock", "lock", body_i="b", function="turn")
    scene.add_force("weight", "gravity")
    compiled = dap.compile(scene, registry=registry_of(Lock))
    rows = compiled.evaluator.rows(0.0, compiled.model.u0)
    np.testing.assert_allclose(rows.dense(), np.eye(6)[3:], atol=1e-14)
    np.testing.assert_allclose(rows.nu, (0.0, 0.0, rate), atol=1e-14)
    np.testing.assert_allclose(rows.gamma, 0.0, atol=1e-14)
    result = dap.simulate(compiled, t_end=1.0, rtol=1e-10)
    np.testing.assert_allclose(result.w[:, 0], np.tile((0.0, 0.0, rate), (len(result.t), 1)),
                               atol=1e-8)  # fmt: skip
    angle = 2.0 * np.arctan2(result.p[-1, 0, 3], result.p[-1, 0, 0])
    assert angle == pytest.approx(rate, abs=1e-8)


class Wave(Function):
    """sin(w x) / (w x), guarded at zero."""

    keyword = "guarded-wave"
    w: float = number(2.0)

    def value(x, w):
        y = w * x
        return where(y * y < 1e-4, 1.0 - y * y / 6.0 * (1.0 - y * y / 20.0), sin(y) / y)


@compiled_alone
def test_a_function_keeps_its_guards():
    """At zero 1, 0, -w^2 / 3, 0; at x = 1 from the derivatives of sin(2 x) / (2 x)."""
    scene = dap.Scene(name="driven")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("guarded-wave", "wave")
    scene.add_force("f", "push", body_i="b", f=(1.0, 0.0, 0.0), function="wave")
    compiled = dap.compile(scene, registry=registry_of(Wave))
    s, c = np.sin(2.0), np.cos(2.0)
    for x, wanted in (
        (0.0, (1.0, 0.0, -4.0 / 3.0, 0.0)),
        (1.0, (s / 2, c - s / 2, s - 2 * c - 2 * s, 6 * c - 4 * c + 6 * s - 3 * s)),
    ):
        found = compiled.evaluator.function_values(x)[0]
        np.testing.assert_allclose(found[:3], wanted[:3], atol=1e-12)
    assert compiled.evaluator.function_values(0.0)[0, 3] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("type_", [Inside, Outside, Logarithm, Polar, Lock, Wave])
def test_check_plugin_finds_nothing_wrong_with_guards(type_):
    report = check_type(type_)
    assert report.ok, str(report)


class Unguarded(Force):
    """A smooth energy, r sin r, by a root that has no slope at zero."""

    keyword = "guard-missing"
    P_i: Point = point()

    def energy(r_P_i):
        r = sqrt(norm2(r_P_i))
        return r * sin(r)


class Corner(Force):
    """An energy with a corner where it has no length, as that of a spring."""

    keyword = "guard-corner"
    P_i: Point = point()

    def energy(r_P_i):
        return sqrt(norm2(r_P_i))


@pytest.mark.slow
def test_check_plugin_tries_exact_rest():
    """A missing guard is a finding where the energy is smooth, and a note where it has a corner."""
    report = check_type(Unguarded)
    assert {f.check for f in report.findings} == {"rest"}
    assert "guard the formula by where" in str(report)
    report = check_type(Corner)
    assert report.ok
    (rest,) = (o for o in report.outcomes if o.check == "rest")
    assert "no slope" in " ".join(rest.notes)
