"""Stiff contact and friction with the implicit integrator: closed forms and SciPy's Radau.
Rounding must not excuse errors of stiff directions (docs/decisions/0071), and a run that does not
get on says why. Scenes of thin bodies, for which rounding is measured, are in test_scales.py."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.levels import quickly

import dap3d_core as dap

G = 9.81
#: Steps a second of motion at most.
STEPS_A_SECOND = 1000


def run(scene, t_end, integrator, **settings):
    """A run of so many reports that its steps are its own."""
    result = dap.simulate(scene, t_end=t_end, dt=t_end / 200.0, integrator=integrator, **settings)
    assert result.stats.steps < STEPS_A_SECOND * t_end
    return result


def ball(k, e, height=0.1, mass=1.0, floor=0.0, **fields):
    """A ball of no radius that falls on a plane."""
    scene = dap.Scene(name="ball")
    scene.add_body("b", mass=mass, Jp=(mass, mass, mass), r=(0.0, 0.0, floor + height))
    scene.add_point("floor", "ground", (0.0, 0.0, floor))
    scene.add_force("weight")
    scene.add_force("plane_stop", "f", P_i="b.O", P_j="floor", e=e, k=k, **fields)
    return scene


def flights(t, height, e, v_rest=1e-3):
    """Height over the plane by parabolas; NaN once contact carries the ball, and from when on."""
    z = np.full(len(t), np.nan)
    begin, v = np.sqrt(2.0 * height / G), np.sqrt(2.0 * G * height)
    z[t <= begin] = height - G * t[t <= begin] ** 2 / 2.0
    while e * v > v_rest and begin < t[-1]:
        v *= e
        inside = (t > begin) & (t <= begin + 2.0 * v / G)
        after = t[inside] - begin
        z[inside] = v * after - G * after**2 / 2.0
        begin += 2.0 * v / G
    return z, begin


def check_ball(result, k, e, height=0.1, mass=1.0, floor=0.0):
    """Flights to 1e-6 of the height; at rest mg / k deep, to 1e-6 of the height."""
    t, z = result.t, result.r[:, 0, 2] - floor
    expected, rest = flights(t, height, e)
    flying = ~np.isnan(expected)
    np.testing.assert_allclose(z[flying], expected[flying], atol=1e-6 * height)
    # The last speed, e times v_rest or less, dies away within some 10 / sqrt(k / m).
    still = t > rest + 0.01 + 20.0 * np.sqrt(mass / k)
    np.testing.assert_allclose(z[still], -mass * G / k, atol=1e-6 * height)
    assert result.ledger["energy"].ok, result.ledger["energy"]


@pytest.mark.parametrize("integrator", ["radau", "auto"])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("k", quickly([1e5, 1e12, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11], 2))
def test_a_ball_on_a_stiff_plane(k, e, integrator):
    """It never flies higher than e^2 of the height before, and comes to rest."""
    check_ball(run(ball(k, e), 2.0, integrator), k, e)


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
@pytest.mark.parametrize("case", [
    {"k": 3e7, "e": 0.5, "height": 1.0},
    {"k": 3e9, "e": 0.7, "mass": 50.0},
    {"k": 2e8, "e": 0.2, "mass": 1e-3},
    {"k": 1e9, "e": 0.3, "floor": 3.0},
])  # fmt: skip
def test_other_balls_at_other_tolerances(case, rtol):
    """Heights, masses, places. Errors of a step are rtol of the largest |r|, some 1e2 of them."""
    where = {name: case[name] for name in ("height", "mass", "floor") if name in case}
    result = run(ball(**case), 2.0, "radau", rtol=rtol)
    expected, _ = flights(result.t, case.get("height", 0.1), case["e"])
    flying = ~np.isnan(expected)
    z = result.r[:, 0, 2] - case.get("floor", 0.0)
    allowed = max(1e2 * rtol, 1e-7) * (where.get("floor", 0.0) + where.get("height", 0.1))
    np.testing.assert_allclose(z[flying], expected[flying], atol=allowed)
    assert np.max(np.abs(result.rd[:, 0, 2])) < 1.001 * np.sqrt(2 * G * where.get("height", 0.1))


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_explicit_methods_agree(integrator):
    """They take steps of the contact's own time, and the same motion."""
    result = dap.simulate(ball(1e9, 0.3), t_end=1.0, integrator=integrator)
    check_ball(result, 1e9, 0.3)


@pytest.mark.parametrize("w_tol", [1e-9, 1e-3])
def test_a_clutch_meets_in_joint_coordinates(w_tol, monkeypatch):
    """As by body coordinates, in no more steps."""
    monkeypatch.setattr(dap, "simulate", partial(dap.simulate, method="joint"))
    test_a_clutch_meets(w_tol, 1e-8, "radau")


@pytest.mark.parametrize("integrator", ["radau", "auto"])
@pytest.mark.parametrize("k", [1e6, 1e8])
def test_a_hinged_arm_on_a_stop(k, integrator):
    """Constraints and contact together. dop853 resolves the contact in hundreds of steps more; the
    bounces of both are those of one energy, to 1e-6 of 1 m."""
    scene = dap.Scene(name="arm")
    scene.add_body("a", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.5, 0.0, 0.0))
    scene.add_point("end", "a", (-0.5, 0.0, 0.0))
    scene.add_point("tip", "a", (0.5, 0.0, 0.0))
    scene.add_point("low", "ground", (0.0, 0.0, -0.3))
    scene.add_joint("rev", "j", P_i="end", P_j="ground.O", a_i="a.y", a_j="ground.y")
    scene.add_force("weight")
    scene.add_force("plane_stop", "f", P_i="tip", P_j="low", e=0.3, k=k)
    result = run(scene, 1.0, integrator)
    other = dap.simulate(scene, t_end=1.0, dt=1.0 / 200.0, integrator="dop853", rtol=1e-10)
    np.testing.assert_allclose(result.r, other.r, atol=1e-6)
    assert result.ledger["energy"].ok


def clutch(w_tol):
    """Two discs, a moment of friction of 3 N m between them."""
    scene = dap.Scene(name="clutch")
    for name, J, w in (("a", 0.4, 30.0), ("b", 0.1, -5.0)):
        scene.add_body(name, mass=1.0, Jp=(J, J, J), w=(0.0, 0.0, w))
        scene.add_joint("rev", "r" + name, P_i=name + ".O", P_j="ground.O",
                        a_i=name + ".z", a_j="ground.z")  # fmt: skip
    scene.add_force("rot_friction", "f", body_i="a", body_j="b", axis="a.z", n_c=3.0, w_tol=w_tol)
    return scene


@pytest.mark.parametrize("integrator", ["radau", "auto"])
@pytest.mark.parametrize("rtol", [1e-8, 1e-6])
@pytest.mark.parametrize("w_tol", quickly([1e-3, 1e-9, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8], 2))
def test_a_clutch_meets(w_tol, rtol, integrator):
    """w_a = 30 - 7.5 t until both are at 23 rad/s, (0.4 30 - 0.1 5) / 0.5, at 35 / 37.5 s. From
    w_tol on friction fades: a difference of w_tol / 37.5 s at most. To 1e-6 of 23 rad/s at the end;
    before to 1e2 rtol, some hundred steps of rtol each. At 1e-6 the explicit method of auto shakes
    about the bend by h 37.5 rad/s^2 until it hands over, within 30 ms, and the first step of radau
    interpolates from there."""
    result = run(clutch(w_tol), 2.0, integrator, rtol=rtol)
    w = result.w[:, :, 2]
    meets, near = 35.0 / 37.5, 10.0 * w_tol + 1e-9
    begin = meets + near
    if integrator == "auto" and rtol > 1e-8:
        note = next(note for note in result.notes if "then radau" in note)
        begin = 0.03 + float(note.split("until t = ")[1].split()[0])
        assert begin < meets + 0.06
    before, after = result.t < meets - near, result.t > begin
    np.testing.assert_allclose(w[-1], 23.0, atol=23e-6)
    np.testing.assert_allclose(w[before, 0], 30.0 - 7.5 * result.t[before], atol=2300.0 * rtol)
    np.testing.assert_allclose(w[after], 23.0, atol=2300.0 * rtol)
    assert result.ledger["energy"].ok


@pytest.mark.parametrize("integrator", ["radau", "auto"])
@pytest.mark.parametrize("kind", ["friction", "tran_friction"])
@pytest.mark.parametrize("v_tol", [1e-3, 1e-5, 1e-7, 1e-9])
def test_a_block_slides_and_stops(v_tol, kind, integrator):
    """From 2 m/s with mu = 0.3: after v^2 / (2 mu g), less what v_tol makes of it, v_tol^2 / a."""
    scene = dap.Scene(name="block")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(2.0, 0.0, 0.0))
    scene.add_vector2("d", "b.O", "ground.O")
    scene.add_joint("tran", "t", a_j="ground.x", d="d")
    scene.add_force("weight")
    a = 0.3 * G
    if kind == "friction":
        scene.add_force("friction", "f", joint="t", mu=0.3, v_tol=v_tol)
    else:
        scene.add_force("tran_friction", "f", P_i="b.O", a_j="ground.x", f_c=a, v_tol=v_tol)
    result = run(scene, 3.0, integrator)
    assert result.r[-1, 0, 0] == pytest.approx(2.0 / a, abs=1e-6)
    assert abs(result.rd[-1, 0, 0]) < 1e-9


def oscillator(sigma_0, sigma_1):
    """2 kg on a spring of 50 N/m, rubbing by bristles."""
    scene = dap.Scene(name="bristles")
    scene.add_body("b", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_vector2("d", "b.O", "ground.O")
    scene.add_joint("tran", "t", a_j="ground.x", d="d")
    scene.add_force("tran_sda", "k", P_i="b.O", P_j="ground.O", a_j="ground.x", k=50.0)
    scene.add_force("lugre", "f", P_i="b.O", a_j="ground.x", f_n=2.0 * G, mu_c=0.15, mu_s=0.15,
                    v_s=1e-3, sigma_0=sigma_0, sigma_1=sigma_1)  # fmt: skip
    return scene


def by_scipy(sigma_0, sigma_1, t):
    """Position at t by SciPy's LSODA, which is within 1e-9 of its Radau."""
    load = 2.0 * G * 0.15

    def rates(_, y):
        x, v, z = y
        z_dot = v - sigma_0 * abs(v) * z / load
        return [v, (-50.0 * x - sigma_0 * z - sigma_1 * z_dot) / 2.0, z_dot]

    found = solve_ivp(rates, (0.0, t), [1.0, 0.0, 0.0], "LSODA", rtol=1e-12, atol=1e-15)
    return found.y[0, -1]


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["radau", pytest.param("auto", marks=pytest.mark.long)])
@pytest.mark.parametrize(("sigma_0", "zeta"), [
    (1e5, 0.3), (1e6, 1.0), (1e7, 0.1), (1e7, 2.0), (1e8, 0.3), (1e9, 1.0),
])  # fmt: skip
def test_bristles(sigma_0, zeta, integrator):
    """Slides back and forth until it sticks, where SciPy has it: to 1e-6 of 1 m."""
    sigma_1 = zeta * np.sqrt(2.0 * sigma_0)
    result = run(oscillator(sigma_0, sigma_1), 6.0, integrator)
    assert result.r[-1, 0, 0] == pytest.approx(by_scipy(sigma_0, sigma_1, 6.0), abs=1e-6)


def test_the_work_of_a_first_step_is_that_of_its_stages():
    """Free flights between jumps: the iteration takes them in one go, from stages where the power
    was that of their start. The energy is right to rounding of 1 J."""
    result = run(ball(1e5, 0.9), 2.0, "radau")
    assert result.ledger["energy"].value < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_run_that_stalls_says_why_and_keeps_what_it_has(integrator):
    """Friction that fades at 1e-13 m/s needs steps of 1e-13 s. What was computed until the block
    stops is right, and the message names what limits the steps and the setting that helps."""
    scene = dap.Scene(name="block")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(2.0, 0.0, 0.0))
    scene.add_vector2("d", "b.O", "ground.O")
    scene.add_joint("tran", "t", a_j="ground.x", d="d")
    scene.add_force("tran_friction", "f", P_i="b.O", a_j="ground.x", f_c=3.0, v_tol=1e-13)
    with pytest.raises(dap.SimulationError, match="so short that it would not end") as caught:
        dap.simulate(scene, t_end=3.0, integrator=integrator)
    words = str(caught.value)
    assert "the velocity of body b" in words
    assert "integrator radau" in words
    kept = caught.value.result
    assert kept.status == "stopped"
    assert 0.6 < kept.t[-1] < 0.7
    expected = 2.0 * kept.t - 1.5 * kept.t**2
    np.testing.assert_allclose(kept.r[:, 0, 0], expected, atol=1e-8)


@pytest.mark.parametrize("e", [0.5, 0.9])
@pytest.mark.parametrize("height", quickly([0.1, 0.37, 0.5]))
@pytest.mark.parametrize(("mass", "k"), [(1e-3, 3e9), (1e-3, 5e10), (0.1, 1e12), (1.0, 1e13)])
def test_a_light_ball_rebounds_every_time(mass, k, height, e):
    """Stages of a step after an impact seemed found, by a first rate of 1e-7 that was that of the
    stiff side of the bend alone: the ball stayed on the plane, its energy gone."""
    result = dap.simulate(
        ball(k, e, height=height, mass=mass), t_end=2.0, dt=0.01, integrator="radau"
    )
    check_ball(result, k, e, height=height, mass=mass)


def test_a_given_step_that_is_too_long_for_a_bend_is_named():
    """No stages are found where the discs of the clutch meet: the run stops, and says what to
    change."""
    with pytest.raises(dap.SimulationError, match=r"a step of 0\.01 s, as given, .* shorter step"):
        dap.simulate(clutch(1e-3), t_end=2.0, dt=0.1, integrator="radau", step=0.01)


@pytest.mark.parametrize("k", [1e5, 1e12])
def test_a_given_step_goes_through_a_contact(k):
    """Without a rebound the ball comes to rest mg / k deep; to 1e-12 of its height of 1 m."""
    result = dap.simulate(
        ball(k, 0.0, height=1.0), t_end=1.0, dt=0.1, integrator="radau", step=0.01
    )
    assert result.r[-1, 0, 2] == pytest.approx(-G / k, abs=1e-12)
