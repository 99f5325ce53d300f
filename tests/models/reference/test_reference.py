"""The reference simulators are right: each is confirmed by a second derivation, or by a balance.
No test here runs dap3d. What they confirm judges it: the numbers of models/**/expected.toml."""

import andrews
import ball1
import bodies2
import bricard
import check_expected
import fourbar
import fourbar2
import fourbar3
import fourbar4
import fourbar_row
import governor
import numpy as np
import pen1
import pen2
import pytest
import quarter_car
import rolling_disk
import tri
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.slow

#: Nothing of dap3d is in them: they change with these scripts and with models/**/expected.toml.
LONG = {"pen2", "bicycle", "bodies2", "quarter_car", "A02-40", "A04"}
MODELS = [
    pytest.param(name, marks=pytest.mark.long) if name in LONG else name
    for name in check_expected.ALL
]


@pytest.mark.parametrize("model", MODELS)
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


@pytest.mark.parametrize("model", [pen1, pytest.param(pen2, marks=pytest.mark.long)])
@pytest.mark.parametrize("t", [0.5, 2.0])
def test_pendulums_against_elliptic_functions(model, t):
    simulated, closed = model.quantities(t), model.closed_form(t)
    for name in closed:
        atol = 1e-9 if name == "v_dot" else 1e-10
        np.testing.assert_allclose(simulated[name], closed[name], rtol=0, atol=atol)


@pytest.mark.parametrize("model", [fourbar3, fourbar2, fourbar4])
@pytest.mark.parametrize("t", [0.25, 2.0])
class TestFourbar:
    @pytest.mark.long
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


@pytest.mark.parametrize("t", [0.0, 0.25, 0.9])
def test_fourbar4_link_carries_the_momentum_of_the_mechanism(t):
    np.testing.assert_allclose(
        fourbar4.quantities(t)["lambda.J6"], fourbar4.held(t), rtol=0, atol=1e-8
    )


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


LONG = pytest.mark.long


@pytest.mark.parametrize(
    ("model", "t", "tolerances"),
    [
        # forces of 1e2 N from accelerations of 1e5 m/s^2
        pytest.param(andrews, 0.01, {"p": 1e-12, "v": 1e-10, "v_dot": 1e-6, "reaction": 1e-8,
                                     "energy": 1e-12}, marks=LONG),
        *((bricard, t, {"r": 1e-11, "p": 1e-11, "v": 1e-11, "v_dot": 1e-10}) for t in (0.5, 2.0)),
        pytest.param(governor, 0.01, {"r": 1e-13, "p": 1e-13, "v": 1e-12, "v_dot": 1e-8,
                                      "reaction": 1e-8}, marks=LONG),
        pytest.param(rolling_disk, rolling_disk.PERIOD, {"r": 1e-10, "p": 1e-10, "v": 1e-9,
                                                         "lambda": 1e-10}, marks=LONG),
    ],
)  # fmt: skip
def test_a_reference_agrees_with_the_generic_simulator(model, t, tolerances):
    """The spatial mechanism, without symmetry; quantity by quantity that starts as a key says."""
    closed, simulated = model.quantities(t), model.simulated(t)
    compared = 0
    for start, atol in tolerances.items():
        for name in closed.keys() & simulated.keys():
            if name == start or name.startswith(f"{start}."):
                np.testing.assert_allclose(
                    closed[name], simulated[name], rtol=0, atol=atol, err_msg=name
                )
                compared += 1
    assert compared >= len(tolerances)


@pytest.mark.parametrize("n", [1, 2, pytest.param(40, marks=pytest.mark.long)])
@pytest.mark.parametrize("t", [0.2, 1.0, 10.0])
def test_row_of_fourbars_in_elliptic_functions(n, t):
    row = fourbar_row.member(n)
    # errors grow with the pendulum's speed, 1e-12 a turn
    np.testing.assert_allclose(row.angle(t)[:2], row.pendulum(t), rtol=0, atol=1e-10)
    quantities = row.quantities(t)
    assert quantities["violation"].max() < 1e-12
    assert quantities["imbalance"].max() < 1e-10


@pytest.mark.parametrize("t", [0.0, 0.01, 0.05])
def test_andrews_in_angles(t):
    angles = andrews.trajectory().at(t)[:7]
    # rtol 1e-13 of 1e-2 m, in each of 1e2 steps
    assert np.abs(andrews.closure(angles)[0]).max() < 1e-13
    start, now = andrews.quantities(0.0), andrews.quantities(t)
    gained = now["energy.total"] - start["energy.total"]
    np.testing.assert_allclose(gained, now["worked"], rtol=0, atol=1e-12)
    assert now["imbalance"].max() < 1e-8  # accelerations of 5e5, masses of 1e-2


@pytest.mark.parametrize("t", [0.5, 2.0, 10.0])
def test_bricard_closes_and_keeps_its_energy(t):
    quantities = bricard.quantities(t)
    assert np.abs(quantities["gap"]).max() < 1e-12
    assert quantities["imbalance"].max() < 1e-11
    np.testing.assert_allclose(quantities["energy.total"], -29.43, rtol=0, atol=1e-11)


@pytest.mark.parametrize("t", [0.05, 0.5])
def test_governor_loses_what_its_dampers_take(t):
    start, now = governor.quantities(0.0), governor.quantities(t)
    assert now["dissipated"] > 2e-3
    lost = start["energy.total"] - now["energy.total"]
    np.testing.assert_allclose(lost, now["dissipated"], rtol=0, atol=1e-12)
    assert now["violation"].max() < 1e-13
    assert now["imbalance"].max() < 1e-8  # damping of 4e4 N s/m


@pytest.mark.parametrize("t", [0.0, 1.0, rolling_disk.PERIOD])
def test_rolling_disk_satisfies_euler(t):
    quantities = rolling_disk.quantities(t)
    assert quantities["imbalance"].max() < 1e-14
    assert quantities["violation"].max() < 1e-14


def test_rolling_disk_has_the_rates_of_the_collection():
    rates = [rolling_disk.SPIN, rolling_disk.HEADING, rolling_disk.PERIOD]
    printed = [10.7364981632612, -1.07364981632612, 5.85217378295632]
    np.testing.assert_allclose(rates, printed, rtol=1e-14, atol=0)  # 15 digits


@pytest.mark.parametrize("t", [0.0, 1.7, 4.0])
def test_tricycle_satisfies_joints_and_newton(t):
    quantities = tri.quantities(t)
    assert quantities["violation"].max() < 1e-14
    assert quantities["imbalance"].max() < 1e-11
    loads = sum(quantities[f"reaction.{joint}.i.force"][2] for joint in ("J6", "J7", "J8"))
    # the mass centres keep their heights, so the loads always add up to the weight
    np.testing.assert_allclose(loads, 25 * 9.81, rtol=0, atol=1e-10)


def test_tricycle_loads_at_the_start_by_moments():
    quantities = tri.quantities(0.0)
    front, rear = tri.loads(quantities["rdd.frame"][0])
    for joint, load in (("J6", front), ("J7", rear), ("J8", rear)):
        found = quantities[f"reaction.{joint}.i.force"][2]
        np.testing.assert_allclose(found, load, rtol=0, atol=1e-11)


def test_tricycle_velocities_and_accelerations_are_derivatives():
    t, h = 2.2, 1e-4
    early, now, late = tri.motion(t - h), tri.motion(t), tri.motion(t + h)
    # second-order differences: h^2 times third derivatives of order 1
    np.testing.assert_allclose((late[0] - early[0]) / (2 * h), now[2][:, :3], rtol=0, atol=1e-7)
    np.testing.assert_allclose((late[2] - early[2]) / (2 * h), now[3], rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [-0.2, 0.0, 0.15])
def test_quarter_car_closes_its_loop(angle):
    m, flat = quarter_car, quarter_car.pose(angle)
    places, (_, upper, upright) = flat[:9].reshape(3, 3), flat[9:36].reshape(3, 3, 3)
    ball = m.UPPER_HINGE + upper @ (m.UPPER_BALL - m.UPPER_HINGE)
    on_upright = [places[2] + upright @ (x - m.CENTRES[2]) for x in (m.UPPER_BALL, m.LEVER)]
    np.testing.assert_allclose(on_upright[0], ball, rtol=0, atol=1e-14)
    rod = np.linalg.norm(on_upright[1] - m.RACK) - np.linalg.norm(m.LEVER - m.RACK)
    assert abs(rod) < 1e-14
    np.testing.assert_allclose(upright @ upright.T, np.eye(3), rtol=0, atol=1e-14)


def test_quarter_car_keeps_its_energy_without_dampers(monkeypatch):
    m = quarter_car
    for name in ("C", "TYRE_C", "BUMP"):
        monkeypatch.setattr(m, name, 0.0)

    def energy(y):
        r, r_1, _, A, w_1, _, strut, _ = m.kinematics(y[1])
        v = r_1 * y[3] + [0.0, 0.0, y[2]]
        w = np.einsum("nij,ni->nj", A, w_1 * y[3])  # in axes of the bodies
        kinetic = m.CAR * y[2] ** 2 + m.MASSES @ (v * v).sum(axis=1) + (m.INERTIAS * w * w).sum()
        bend = m.CHASSIS[2] + y[0] + r[2, 2] - m.TYRE
        springs = m.K * (np.linalg.norm(strut) - m.STRUT) ** 2 + m.TYRE_K * bend**2
        weight = m.GRAVITY * (m.CAR * y[0] + m.MASSES @ (y[0] + r[:, 2]))
        return 0.5 * (kinetic + springs) + weight

    start = np.array([0.02, -0.05, 0.1, 1.0])
    run = solve_ivp(m.rate, (0.0, 0.5), start, "DOP853", rtol=1e-12, atol=1e-13)
    change = energy(run.y[:, -1]) - energy(start)
    assert abs(change) < 1e-8  # of 3e2 J in the spring
