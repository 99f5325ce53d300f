"""Laws of friction of contact types of one's own, against closed forms, to 1e-9 at rtol 1e-12."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Contact, PluginError, Point, Vector, examine, number, point, vector
from dap3d_core.kernels import dot, exp, sub, where
from dap3d_core.testing import checks_for

G, MASS = 9.81, 2.0
TIGHT = {"rtol": 1e-12, "atol": 1e-14}
INTEGRATORS = ("dop853", "radau", "adams")


class Stribeck(Contact):
    """A point at z = 0 whose friction falls from mu_s to mu with the speed of slip."""

    keyword = "test-stribeck"
    P_i: Point = point()
    v_s: float = number(unit="m/s", positive=True)

    def gap(r_P_i):
        return r_P_i[2]

    def at(r_P_i):
        return r_P_i

    def normal():
        return (0.0, 0.0, 1.0)

    def grip(speed, mu, mu_s, v_s):
        return mu + (mu_s - mu) * exp(-((speed / v_s) ** 2))


class Runner(Contact):
    """A point at a plane of body j, with friction mu_a along a_j and mu_b across it."""

    keyword = "test-runner"
    P_i: Point = point()
    P_j: Point = point("ground.O")
    n_j: Vector = vector("ground.z")
    a_j: Vector = vector("ground.x")
    mu_a: float = number(positive=True)
    mu_b: float = number(positive=True)

    def gap(r_P_i, r_P_j, n_j):
        return dot(n_j, sub(r_P_i, r_P_j))

    def at(r_P_i):
        return r_P_i

    def normal(n_j):
        return n_j

    def grain(a_j):
        return a_j

    def grip(mu_a, mu_b):
        return mu_a, mu_b


REGISTRY = registry_of(Stribeck, Runner)
LAW = {"mu": 0.2, "mu_s": 0.5, "v_s": 0.3}
ALONG, ACROSS = 0.2, 0.5
ELLIPSE = {"mu_a": ALONG, "mu_b": ACROSS}


def mu_at(v):
    """The coefficient of Stribeck at a speed."""
    return LAW["mu"] + (LAW["mu_s"] - LAW["mu"]) * np.exp(-((v / LAW["v_s"]) ** 2))


def block(keyword, v=(0.0, 0.0, 0.0), **contact):
    """A block on the ground, which touches it below its mass centre: it does not turn."""
    scene = dap.Scene(name="block")
    scene.add_body("b", mass=MASS, Jp=[1.0, 1.0, 1.0], r_dot=list(v))
    scene.add_force("weight", "g")
    scene.add_contact(keyword, "floor", P_i="b.O", **contact)
    return scene


def run(scene, t_end, integrator="dop853", **settings):
    """Simulate with the types of this file."""
    settings = {**TIGHT, "dt": 0.1, **settings}
    compiled = dap.compile(scene, registry=REGISTRY)
    return dap.simulate(compiled, t_end=t_end, integrator=integrator, **settings)


def times(result, kind):
    """Instants of events of a kind."""
    return [e.t for e in result.events if e.kind == kind]


@pytest.mark.slow
@pytest.mark.parametrize("class_", [Stribeck, Runner])
def test_the_formulas_are_right(class_):
    failed = [str(outcome) for check in checks_for(class_) if not (outcome := check.run()).ok]
    assert not failed


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_friction_that_falls_with_slip_stops_a_block(integrator):
    """v_dot = -g mu(v): it stops after the integral of 1 / (g mu)."""
    result = run(block("test-stribeck", (2.0, 1.0, 0.0), **LAW), 1.5, integrator)
    v = np.hypot(2.0, 1.0)
    t = quad(lambda v: 1.0 / (G * mu_at(v)), 0.0, v, epsabs=1e-12, epsrel=1e-12, points=[0.3])[0]
    assert times(result, "stick") == pytest.approx([t], abs=1e-9)
    assert np.max(np.abs(result.rd[-1])) < 1e-12
    assert result.ledger["energy"].value < 1e-9


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_block_sticks_and_slips_on_a_spring_that_is_drawn(integrator):
    """It slips where k V t = mu_s m g, smoothly, and sticks where its speed is zero again."""
    V, k = 0.1, 50.0
    scene = block("test-stribeck", **LAW)
    scene.add_body("cart", mass=1.0, Jp=[1.0, 1.0, 1.0], r=[1.0, 0.0, 0.0], r_dot=[V, 0.0, 0.0])
    scene.add_joint("tran", "rail", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    scene.add_function("a", "ramp", coeff=[0.0, V, 0.0])
    pull = {"body_i": "cart", "body_j": "ground", "a_j": "ground.x", "function": "ramp"}
    scene.add_joint("drive-tran", "drive", **pull)
    scene.add_force("ptp", "spring", P_i="b.O", P_j="cart.O", k=k, l0=1.0)
    result = run(scene, 3.2, integrator)
    slips = LAW["mu_s"] * MASS * G / (k * V)

    def rates(t, y):
        return y[1], (k * (V * t - y[0]) - mu_at(y[1]) * MASS * G) / MASS

    def speed(_, y):
        return y[1]

    speed.terminal, speed.direction = True, -1
    until = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15, "events": speed}
    found = solve_ivp(rates, (slips, 5.0), [0.0, 0.0], **until)
    assert times(result, "slip") == pytest.approx([slips], abs=1e-9)
    assert times(result, "stick") == pytest.approx([found.t[-1]], abs=1e-9)
    assert result.r[-1, 0, 0] == pytest.approx(found.y[0, -1], abs=1e-9)
    assert result.ledger["energy"].value < 1e-9


def runner_closed_form(v1, v2):
    """Duration and path of a slip (v1, v2) against friction in an ellipse.

    v1_dot = -g a^2 v1 / s, v2_dot = -g b^2 v2 / s, s^2 = (a v1)^2 + (b v2)^2: v2 = C v1^(b^2 / a^2)
    """
    power = (ACROSS / ALONG) ** 2
    C = v2 / v1**power

    def integral(of):
        def rate(v):
            return np.hypot(ALONG * v, ACROSS * C * v**power) / (G * ALONG**2 * v) * of(v)

        return quad(rate, 0.0, v1, epsabs=1e-13, epsrel=1e-12)[0]

    return integral(lambda v: 1.0), integral(lambda v: v), integral(lambda v: C * v**power)


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_friction_in_an_ellipse_bends_the_path(integrator):
    """Of a grain that is turned by an angle."""
    v, angle = np.array([1.0, 1.5]), 0.7
    t, *path = runner_closed_form(*v)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    scene = block("test-runner", (*turn @ v, 0.0), a_j="grain", **ELLIPSE)
    scene.add_vector("grain", "ground", [*turn[:, 0], 0.0])
    result = run(scene, 1.0, integrator)
    assert times(result, "stick") == pytest.approx([t], abs=1e-9)
    assert result.r[-1, 0, :2] == pytest.approx(turn @ path, abs=1e-9)
    assert result.ledger["energy"].value < 1e-9


@pytest.mark.parametrize("part", [0.999, 1.001])
def test_what_sticks_holds_within_the_ellipse(part):
    """At its rim it slips along the normal of the ellipse."""
    angle = 1.1
    push = part * MASS * G * np.array([ALONG * np.cos(angle), ACROSS * np.sin(angle)])
    scene = block("test-runner", **ELLIPSE)
    scene.add_force("f", "push", body_i="b", f=[*push, 0.0])
    result = run(scene, 1.0)
    if part < 1.0:
        assert set(result.contact("floor").mode) == {2}
        assert np.max(np.abs(result.r)) < 1e-14
        return

    def rates(_, v):
        size = np.hypot(ALONG * v[0], ACROSS * v[1])
        return (push - MASS * G * np.array([ALONG**2 * v[0], ACROSS**2 * v[1]]) / size) / MASS

    start = 1e-13 * push / [ALONG**2, ACROSS**2]
    found = solve_ivp(rates, (0.0, 1.0), start, method="Radau", rtol=1e-11, atol=1e-15)
    assert result.rd[-1, 0, :2] == pytest.approx(found.y[:, -1], abs=1e-9)


def test_an_impact_with_friction_in_an_ellipse():
    """A drop with slip that lasts: the impulse m v (-a^2 c, -b^2 s) / size of a slip (c, s)."""
    fall, v = 1.0, np.array([6.0, 8.0])
    scene = block("test-runner", (*v, -fall), **ELLIPSE)
    result = run(scene, 0.0, dt=1.0)
    after = result.events[0].u_after[7:9]
    assert ACROSS * fall < 1.0  # so little that the slip keeps its direction nearly
    middle = 0.5 * (v + after)
    size = np.hypot(ALONG * after[0], ACROSS * after[1])
    change = -fall * np.array([ALONG**2, ACROSS**2]) * after / size
    assert after - v == pytest.approx(change, abs=1e-12)
    work = MASS * (after - v) @ middle - 0.5 * MASS * fall**2
    assert result.events[0].work == pytest.approx(work, abs=1e-12)


@pytest.mark.parametrize(("keyword", "law"), [("test-runner", ELLIPSE), ("test-stribeck", LAW)])
def test_steps_extrapolate_to_events(keyword, law):
    """Slip that turns, or slows: errors of order h, whose limit by h, h/2, h/4 is 1e-6 away."""
    scene = block(keyword, (1.5, 2.0, 0.0), **law)
    steps = [{}] + [{"contact": "stepping", "contact_step": h, "rtol": 1e-6}
                    for h in (2e-3, 1e-3, 5e-4)]  # fmt: skip
    exact, first, second, third = (run(scene, 0.3, **settings).u[-1] for settings in steps)
    assert 0.0 < np.abs(first - exact).max() < 2e-3
    assert np.abs((8.0 * third - 6.0 * second + first) / 3.0 - exact).max() < 1e-6


@pytest.mark.slow
def test_a_law_that_jumps_or_drives_is_found():
    class Jump(Stribeck):
        keyword = "test-jump"

        def grip(speed, mu, mu_s):
            return where(speed > 0.0, mu, mu_s + 0.1)

    class Later(Stribeck):
        keyword = "test-later"

        def grip(speed, mu, mu_s):
            return where(speed > 0.2, mu, mu_s + 0.1)

    class Driving(Stribeck):
        keyword = "test-driving"

        def grip(speed):
            return 0.3 - 10.0 * speed

    laws = (Jump, "grip jumps where slip"), (Later, "as slip becomes"), (Driving, "would drive")
    for class_, words in laws:
        (check,) = [check for check in checks_for(class_) if check.name == "grip"]
        assert words in str(check.run())


def test_two_coefficients_without_a_grain_are_refused():
    class Lost(Stribeck):
        keyword = "test-lost"

        def grip(mu, mu_s):
            return mu, mu_s

    with pytest.raises(PluginError, match="or those along a vector grain and across it"):
        examine(Lost)


@pytest.mark.parametrize(("pull", "holds"), [((0.1, 0.4), True), ((0.19, 0.2), False)])
def test_inverse_dynamics_hold_within_the_ellipse(pull, holds):
    """Pulls, in parts of the weight, that need 0.94 and 1.03 of the ellipse."""
    scene = block("test-runner", **ELLIPSE)
    del scene.forces["g"]
    scene.add_force("weight", "g", gravity=G, wgt=[*pull, -1.0])
    t = np.linspace(0.0, 1.0, 6)
    places = ("r.x", "r.y", "r.z", "p.e1", "p.e2", "p.e3")
    motion = {"t": t} | {f"b.{name}": 0.0 * t for name in places}
    found = dap.inverse(dap.compile(scene, registry=REGISTRY), motion, actuators=[])
    needed = -MASS * G * np.array([*pull, 0.0])
    assert any("cannot do its part" in note for note in found.notes) != holds
    assert found.contact("floor").friction[2] == pytest.approx(needed, abs=1e-9)


def test_inverse_dynamics_find_friction_of_a_slip_in_an_ellipse():
    """As the run whose motion it is."""
    scene = block("test-runner", (1.0, 1.5, 0.0), **ELLIPSE)
    compiled = dap.compile(scene, registry=REGISTRY)
    result = dap.simulate(compiled, t_end=0.2, dt=0.05, **TIGHT)
    found = dap.inverse(compiled, result, actuators=[])
    one, other = result.contact("floor"), found.contact("floor")
    assert np.abs(one.friction - other.friction).max() < 1e-9
