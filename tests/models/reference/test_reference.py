"""The reference simulators are right: each is confirmed by a second derivation, or by a balance.

No test here runs dap3d. What they confirm judges it: the numbers in models/*/expected.toml.
"""

import ball1
import bodies2
import check_expected
import fourbar
import fourbar2
import fourbar3
import numpy as np
import pen1
import pen2
import pytest
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("model", check_expected.NAMES)
def test_expected_numbers_agree_with_the_reference(model):
    wrong = [str(c) for c in check_expected.comparisons(model) if not c.ok]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("t", [0.5, 2.0])
def test_bodies2_from_angular_momenta(t):
    quantities = bodies2.quantities(t)
    r, A, v, w = bodies2.unpack_momenta(bodies2.momenta().at(t))
    for i, name in enumerate(bodies2.NAMES):
        np.testing.assert_allclose(quantities[f"r.{name}"], r[i], rtol=0, atol=1e-12)
        np.testing.assert_allclose(quantities[f"rd.{name}"], v[i], rtol=0, atol=1e-12)
        np.testing.assert_allclose(quantities[f"w.{name}"], w[i], rtol=0, atol=1e-11)
        turned = bodies2.rotation(quantities[f"p.{name}"])
        np.testing.assert_allclose(turned, A[i], rtol=0, atol=1e-12)


def test_bodies2_energy_lost_is_what_the_dampers_took():
    start, end = bodies2.quantities(0.0), bodies2.quantities(2.0)
    assert end["dissipated"] > 10.0
    lost = start["energy.total"] - end["energy.total"]
    np.testing.assert_allclose(lost, end["dissipated"], rtol=0, atol=1e-11)


def test_ball1_against_an_integration_with_located_touches():
    t, y, touching = 0.0, np.array([ball1.Z0 - ball1.RADIUS, 0.0]), False

    def rhs(_, y):
        spring = -ball1.K * y[0] - ball1.DAMPING * y[1] if touching else 0.0
        return [y[1], spring / ball1.MASS - ball1.GRAVITY]

    def touch(_, y):
        return y[0]

    touch.terminal = True
    for piece in ball1.pieces()[1:7]:
        touch.direction = 1 if touching else -1
        run = solve_ivp(rhs, (t, t + 2), y, "DOP853", rtol=1e-13, atol=1e-15, events=touch)
        t, y, touching = run.t[-1], np.array([0.0, run.y[1, -1]]), not touching
        assert t == pytest.approx(piece.start, rel=0, abs=1e-11)
        assert y[1] == pytest.approx(piece.speed, rel=0, abs=1e-9)
        assert touching == piece.touching


@pytest.mark.parametrize("model", [pen1, pen2])
@pytest.mark.parametrize("t", [0.0, 0.5, 2.0])
def test_pendulums_against_elliptic_functions(model, t):
    simulated, closed = model.quantities(t), model.closed_form(t)
    for name in closed:
        atol = 1e-9 if name == "v_dot" else 1e-10
        np.testing.assert_allclose(simulated[name], closed[name], rtol=0, atol=atol)


@pytest.mark.parametrize("model", [fourbar3, fourbar2])
@pytest.mark.parametrize("t", [0.0, 0.25, 0.5, 0.9, 2.0])
class TestFourbar:
    def test_closed_form_against_the_simulator(self, model, t):
        closed, simulated = model.quantities(t), model.simulated(t)
        for name in closed.keys() & simulated.keys() - {"imbalance", "violation"}:
            reaction = name.startswith(("reaction", "lambda", "energy"))
            atol = 1e-8 if reaction else 1e-9 if name.startswith(("v_dot", "rdd", "wd")) else 1e-10
            np.testing.assert_allclose(
                closed[name], simulated[name], rtol=0, atol=atol, err_msg=name
            )

    def test_closed_form_satisfies_joints_and_newton(self, model, t):
        quantities = model.quantities(t)
        assert quantities["violation"].max() < 1e-12
        assert quantities["imbalance"].max() < 1e-10

    def test_driver_gives_the_power_the_energy_needs(self, model, t):
        driver = model.SYSTEM.driver.name
        moment = model.quantities(t)[f"reaction.{driver}.i.moment"]
        expected = [model.driver_moment(t), 0.0, 0.0]
        np.testing.assert_allclose(moment, expected, rtol=0, atol=1e-9)


def test_fourbar_velocities_and_accelerations_are_derivatives():
    t, h = 0.3, 1e-5
    for part in (fourbar.crank, fourbar.follower, fourbar.coupler):
        early, now, late = part(t - h), part(t), part(t + h)
        np.testing.assert_allclose((late[0] - early[0]) / (2 * h), now[2][:3], atol=1e-7)
        np.testing.assert_allclose((late[2] - early[2]) / (2 * h), now[3], atol=1e-6)


def test_fourbar_crank_makes_full_turns():
    angles = [fourbar.follower_angle(t)[0] for t in np.arange(720) / 720]
    swing = np.degrees([min(angles), max(angles)])
    np.testing.assert_allclose(swing, [-71.177, 7.862], atol=1e-3)
    assert np.abs(np.diff(angles)).max() < np.radians(1.0)  # one branch, without a jump


def test_fourbar_assembles_from_the_rough_start_of_the_figure():
    lean = np.arctan2(4.0, 5.0)  # coupler along (0, 4, 5): a turn by -lean about x
    coupler_p = (np.cos(lean / 2), -np.sin(lean / 2), 0.0, 0.0)
    rough = fourbar3.system((0.0, 2.0, 4.5), coupler_p, (0.0, 4.0, 3.5), (1.0, 0.0, 0.0, 0.0))
    history = rough.corrected()[3]
    assert history == pytest.approx([1.2e-3, 1.6e-6, 1.3e-12], rel=0.05)
