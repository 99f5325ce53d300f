"""Contact of types that act by impulses alone: bounces in closed form, and no way through.

A ball falls 0.5 m onto z = 0.1. With e < 1 it comes to rest at t = sqrt(2 h / g) (1 + e) / (1 - e),
and nothing carries it: the run ends there, whichever form the impulse has. What passes by design,
a gate that slows or kicks, is let through.
"""

import numpy as np
import pytest
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Point, body, number, point
from dap3d_core.kernels import cross, where
from dap3d_core.testing import check_type

G, HEIGHT, LEVEL = 9.81, 0.5, 0.1
FALL = np.sqrt(2.0 * HEIGHT / G)
ZERO = (0.0, 0.0, 0.0)
CARRIED = r"force floor comes to rest in contact, and nothing carries it"


class Rows(Force):
    """An impact on z = 0.1 by the rate of the gap."""

    keyword, ground_axes, unilateral = "impact-rows", True, (0,)
    body_i: Body = body()
    e: float = number(minimum=0.0, maximum=1.0)

    def switch(r_i):
        return r_i[2] - 0.1

    def impulse(Jv, e):
        return where(Jv < 0.0, -(1.0 + e) * Jv, 0.0)


class Impulse(Force):
    """The same by an impulse on the body."""

    keyword, ground_axes = "impact-impulse", True
    body_i: Body = body()
    e: float = number(minimum=0.0, maximum=1.0)

    def switch(r_i):
        return r_i[2] - 0.1

    def impulse(v_i, crossing, mass_i, e):
        hit = (crossing < 0.0) & (v_i[2] < 0.0)
        return (((0.0, 0.0, where(hit, -(1.0 + e) * mass_i * v_i[2], 0.0)), ZERO),)


class Gate(Force):
    """Where the body passes z = 0.1 its vertical velocity is multiplied by a factor."""

    keyword, ground_axes, gives_energy = "gate", True, True
    body_i: Body = body()
    factor: float = number()

    def switch(r_i):
        return r_i[2] - 0.1

    def impulse(v_i, mass_i, factor):
        return (((0.0, 0.0, (factor - 1.0) * mass_i * v_i[2]), ZERO),)


def ball(type_, z=LEVEL + HEIGHT, v=ZERO, gravity=G, x=0.0, **fields):
    scene = dap.Scene(name="drop")
    scene.add_body("b", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(x, 0.0, z), r_dot=v)
    scene.add_force("weight", "gravity", gravity=gravity)
    scene.add_force(type_.keyword, "floor", body_i="b", **fields)
    return dap.compile(scene, registry=registry_of(type_))


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("type_", [Rows, Impulse])
@pytest.mark.parametrize("settings", [{}, {"integrator": "rk4", "step": 1e-3}, {"method": "auto"}])
def test_a_ball_does_not_fall_through_the_floor(type_, e, settings):
    """Bounces shorter than the rounding of positions are the end: sqrt(2 1e-16 / g), 1e-8 s."""
    with pytest.raises(dap.SimulationError, match=CARRIED) as error:
        dap.simulate(ball(type_, e=e), t_end=5.0, dt=0.1, **settings)
    result = error.value.result
    assert result.status == "stopped"
    assert result.r[:, 0, 2].min() > LEVEL - 1e-9
    stopped = float(str(error.value).split("t = ")[1].split(" s")[0])
    ends = FALL * (1.0 + e) / (1.0 - e)
    # the hops below rounding are left out: each is e times as long as the one before it
    assert ends - 1e-4 < stopped < ends + 1e-6


@pytest.mark.parametrize("type_", [Rows, Impulse])
@pytest.mark.parametrize("v", [ZERO, (1e3, 0.0, 0.0), (0.0, 0.0, -1e-12)])
def test_contact_at_the_start_is_not_let_through(type_, v):
    with pytest.raises(dap.SimulationError, match=rf"t = 0 s: {CARRIED}"):
        dap.simulate(ball(type_, z=LEVEL, v=v, e=0.5), t_end=1.0)


@pytest.mark.parametrize("type_", [Rows, Impulse])
def test_what_closes_at_the_start_rebounds(type_):
    """Thrown down at 1 m/s from the floor: up at e, and there again after 2 e / g."""
    result = dap.simulate(ball(type_, z=LEVEL, v=(0.0, 0.0, -1.0), e=0.8), t_end=0.1)
    assert result.rd[-1, 0, 2] == pytest.approx(0.8 - 0.1 * G, abs=1e-9)


@pytest.mark.parametrize("type_", [Rows, Impulse])
def test_what_leaves_or_slides_is_no_contact_that_stays(type_):
    """Thrown up from the floor; and along it without a weight."""
    result = dap.simulate(ball(type_, z=LEVEL, v=(0.0, 0.0, 2.0), e=0.8), t_end=0.1)
    assert result.rd[-1, 0, 2] == pytest.approx(2.0 - 0.1 * G, abs=1e-9)
    result = dap.simulate(ball(type_, z=LEVEL, v=(1.0, 0.0, 0.0), gravity=0.0, e=0.8), t_end=1.0)
    np.testing.assert_allclose(result.r[-1, 0], (1.0, 0.0, LEVEL), atol=1e-12)


@pytest.mark.parametrize("factor", [0.5, 1.5, 0.01])
def test_a_gate_is_passed(factor):
    """It does not stop what comes: v at the gate is sqrt(2 g h), afterwards factor times that."""
    result = dap.simulate(ball(Gate, factor=factor), t_end=FALL + 0.1, rtol=1e-10)
    v = -factor * G * FALL
    assert result.r[-1, 0, 2] == pytest.approx(LEVEL + 0.1 * v - 0.5 * G * 0.01, abs=1e-8)


class Kick(Force):
    """An impact that creates energy: v becomes -2.2 v, its square 4.84 times what it was."""

    keyword, ground_axes = "kick", True
    body_i: Body = body()

    def switch(r_i):
        return r_i[2]

    def impulse(v_i, mass_i, crossing):
        return (((0.0, 0.0, where(crossing < 0.0, -3.2 * mass_i * v_i[2], 0.0)), ZERO),)


class RowsThatKick(Force):
    """The same by a row, without a word on restitution."""

    keyword, ground_axes = "kick-rows", True
    body_i: Body = body()

    def switch(r_i):
        return r_i[2]

    def impulse(Jv):
        return where(Jv < 0.0, -3.2 * Jv, 0.0)


class Charge(Force):
    """An impulse of a given size; it follows no velocity."""

    keyword = "charge"
    P_i: Point = point()
    size: float = number()

    def switch(t):
        return t - 1.0

    def impulse(s_P_i, size):
        P = (0.0, 0.0, size)
        return ((P, cross(s_P_i, P)),)


@pytest.mark.parametrize("type_", [Kick, RowsThatKick])
def test_energy_that_an_impulse_creates_is_found(type_):
    report = check_type(type_)
    assert {f.check for f in report.findings} == {"impulse energy"}
    assert "grows by 384 %" in str(report)


@pytest.mark.parametrize("type_", [Charge, Gate, Rows, Impulse])
def test_charges_and_losses_are_in_order(type_):
    report = check_type(type_)
    assert report.ok, str(report)


def floor(keyword, law, level, above=0.0):
    """A floor at z = 0 whose force is law(z, k) below it, and whose switch is at a level."""

    class Floor(Force):
        P_i: Point = point()
        k: float = number(1e4)

        def wrench(r_P_i, s_P_i, k):
            F = (0.0, 0.0, where(r_P_i[2] < 0.0, law(r_P_i[2], k), above))
            return ((F, cross(s_P_i, F)),)

    Floor.keyword, Floor.ground_axes = keyword, True
    if level is None:
        return Floor
    members = {"switch": lambda r_P_i: r_P_i[2] - level, "keyword": keyword}
    return type("Switched", (Floor,), members)


@pytest.mark.parametrize("level", [0.2, -1e-3, None])
def test_a_jump_that_no_switch_sees_is_found(level):
    """50 N at z = 0, with the switch elsewhere or none."""
    report = check_type(floor("jumps", lambda z, k: -k * z + 50.0, level))
    assert {f.check for f in report.findings} == {"branches"}
    assert "wrench jumps by" in str(report)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "level"), [(lambda z, k: -k * z + 50.0, 0.0), (lambda z, k: -k * z, 0.2)]
)
def test_a_switch_at_the_jump_or_a_law_without_one_is_in_order(law, level):
    report = check_type(floor("right", law, level))
    assert report.ok, str(report)


class Clockwork(Force):
    """Pushes from t = 0.5 on, and at speeds above 1 m/s; only the first has a switch."""

    keyword, ground_axes = "clockwork", True
    body_i: Body = body()

    def wrench(t, v_i):
        late, fast = where(t < 0.5, 0.0, 2.0), where(v_i[0] > 1.0, 3.0, 0.0)
        return (((late + fast, 0.0, 0.0), ZERO),)

    def switch(t):
        return t - 0.5


def test_jumps_over_time_and_velocity_are_found_too():
    report = check_type(Clockwork)
    (finding,) = report.findings
    assert finding.check == "branches"
    assert "jumps by 3" in finding.words
    assert "velocity of body i along x" in finding.words
