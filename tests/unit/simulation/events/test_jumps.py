"""Jumps of velocities in runs: instants, velocities and energies against closed forms.

Where no other reason is given a tolerance of 1e-12 is some hundred roundings of numbers of size 1,
and leaves the mark of 1e-10 a hundredfold.
"""

import numpy as np
import pytest
from support.bouncing import bouncing, swinging
from support.jumping import JUMPING
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import open_result

G, V0, E = 9.81, np.sqrt(2.0 * 9.81), 0.8
TIGHT = {"rtol": 1e-12, "atol": 1e-12}


def ball(type_="test-bounce", **fields):
    """A ball of 2 kg, 1 m above the plane z = 0, with a speed of 0.5 m/s along it."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0), r_dot=(0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=G)
    scene.add_force(type_, "floor", P_i="ball.O", **fields)
    return dap.compile(scene, registry=JUMPING)


def impacts(count, e=E):
    """(count, 3) instants, speeds before and after of the first impacts."""
    before = V0 * e ** np.arange(count)
    flights = np.append(V0 / G, 2.0 * before[1:] / G)
    return np.column_stack([np.cumsum(flights), before, e * before])


def jumps_of(result):
    return [event for event in result.events if event.kind == "jump"]


@pytest.mark.parametrize(
    "settings",
    [
        TIGHT,
        TIGHT | {"integrator": "dopri5"},
        TIGHT | {"integrator": "adams"},
        TIGHT | {"integrator": "radau"},
        {"integrator": "rk4", "step": 0.02},  # of order 4, exact in free flight
        TIGHT | {"integrator": "dop853", "step": 0.01},
    ],
)
def test_a_ball_bounces_with_its_coefficient_of_restitution(settings):
    """Instants, velocities, energy: of the closed form; the ledger closes over the jumps."""
    result = dap.simulate(ball(e=E), t_end=2.0, **settings)
    jumps = jumps_of(result)
    found = [(j.t, -j.u[9], j.u_after[9]) for j in jumps]
    np.testing.assert_allclose(found, impacts(3), rtol=0.0, atol=1e-12)
    works = [-0.5 * 2.0 * (1.0 - E**2) * v**2 for _, v, _ in impacts(3)]
    assert [j.work for j in jumps] == pytest.approx(works, rel=1e-12)
    assert all(j.u[7] == j.u_after[7] and j.name == "force floor" for j in jumps)
    assert result.ledger["energy"].value < 1e-12
    assert "total energy" not in result.ledger  # the impacts take some
    assert len(result.t) == 101


@long_in_plain_python
@pytest.mark.parametrize("moving", [1, 2])
def test_as_many_balls_leave_a_cradle_as_hit_it(moving):
    """Balls of 0.5 m at 2 m/s, 0.3 m before three at rest that touch: at 0.15 s, all at once."""
    scene = dap.Scene(name="cradle")
    count, gap, speed = moving + 3, 0.3, 2.0
    for k in range(count):
        near, v = (k * 0.5 - gap, speed) if k < moving else (k * 0.5, 0.0)
        scene.add_body(f"b{k}", mass=0.7, Jp=(0.1, 0.1, 0.1), r=(near, 0.0, 0.0),
                       r_dot=(v, 0.0, 0.0))  # fmt: skip
    for k in range(count - 1):
        ends = {"P_i": f"b{k}.O", "P_j": f"b{k + 1}.O"}
        scene.add_force("ptp_stop", f"c{k}", l_stop=0.5, e=1.0, k=1e3, **ends)
    result = dap.simulate(scene, t_end=0.4, dt=0.1, **TIGHT)
    v = np.array([0.0] * 3 + [speed] * moving)
    np.testing.assert_allclose(result.rd[-1, :, 0], v, rtol=0.0, atol=1e-12)
    last = np.array([0.5 * k - gap * (k < moving) + (speed * 0.15 if k < moving else 0.0)
                     for k in range(count)])  # fmt: skip
    np.testing.assert_allclose(result.r[-1, :, 0], last + v * 0.25, rtol=0.0, atol=1e-12)
    assert len(jumps_of(result)) >= 1
    assert all(j.t == pytest.approx(0.15, abs=1e-12) for j in jumps_of(result))
    assert result.ledger["energy"].value < 1e-12


def test_reports_from_the_instant_of_a_jump_on_are_states_after_it():
    """A disc is struck at t = 0.5, the last instant before which is a reporting time."""
    scene = dap.Scene(name="stage")
    scene.add_body("rocket", mass=2.0, Jp=(1.0, 2.0, 3.0), w=(0.0, 0.0, 1.0))
    scene.add_point("nozzle", body="rocket", sPp=(0.0, 1.0, 0.0))
    stage = {"P_i": "nozzle", "d_i": "rocket.x", "t_fire": 0.5, "impulse_size": 4.0}
    scene.add_force("test-stage", "stage", **stage)
    result = dap.simulate(dap.compile(scene, registry=JUMPING), t_end=1.0, dt=0.25, **TIGHT)
    (jump,) = jumps_of(result)
    assert jump.t == pytest.approx(0.5, abs=1e-15)
    v = (2.0 * np.cos(0.5), 2.0 * np.sin(0.5), 0.0)
    after = result.t >= jump.t
    assert after.sum() == 2
    for k in np.flatnonzero(after):
        np.testing.assert_allclose(result.rd[k, 0], v, atol=1e-12)
        np.testing.assert_allclose(result.w[k, 0], (0.0, 0.0, 1.0 - 4.0 / 3.0), atol=1e-12)
    assert not result.rd[~after].any()
    assert result.ledger["energy"].value < 1e-12


@pytest.mark.parametrize("method", ["standard", "lsq", "penalty", "joint"])
def test_a_clutch_makes_the_speeds_of_two_shafts_one(method):
    """J_1 = 0.5, J_2 = 2 kg m^2 at 3 and -1 rad/s: (1.5 - 2) / 2.5 rad/s after it."""
    scene = dap.Scene(name="clutch")
    for name, x, J, w in (("a", 0.0, 0.5, 3.0), ("b", 2.0, 2.0, -1.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, J), r=(x, 0.0, 0.0), w=(0.0, 0.0, w))
        scene.add_point(f"on_{name}", body="ground", sPp=(x, 0.0, 0.0))
        ends = {"P_i": f"{name}.O", "P_j": f"on_{name}", "a_i": f"{name}.z", "a_j": "ground.z"}
        scene.add_joint("rev", f"axle_{name}", **ends)
    scene.add_force("test-clutch", "clutch", body_i="a", a_j="b.z", t_on=0.123)
    result = dap.simulate(
        dap.compile(scene, registry=JUMPING, method=method), t_end=1.0, dt=0.1, **TIGHT
    )
    (jump,) = jumps_of(result)
    assert jump.t == pytest.approx(0.123, abs=1e-14)
    np.testing.assert_allclose(result.w[2:, :, 2], -0.2, rtol=0.0, atol=1e-12)
    assert jump.work == pytest.approx(-0.5 * 0.4 * 4.0**2, rel=1e-12)
    assert result.ledger["energy"].value < 1e-12


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "lsq", "joint"])
def test_a_hinged_bar_rebounds_from_a_stop_of_its_angle(method):
    """Without gravity it turns at 2 rad/s to the stop at 1 rad, and back at 1.5 to that at -0.5."""
    scene = dap.Scene(name="bar")
    scene.add_body("bar", mass=2.0, Jp=(0.1, 0.3, 0.3), r=(0.7, 0.0, 0.0), r_dot=(0.0, 1.4, 0.0),
                   w=(0.0, 0.0, 2.0))  # fmt: skip
    scene.add_point("pin", body="bar", sPp=(-0.7, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bar.z", a_j="ground.z")
    angle = {"v_i": "bar.x", "v_j": "ground.x", "axis": "ground.z", "k": 1e5, "e": 0.75}
    scene.add_force("rot_stop", "upper", theta_stop=-1.0, side="min", **angle)
    scene.add_force("rot_stop", "lower", theta_stop=0.5, side="max", **angle)
    result = dap.simulate(scene, method=method, t_end=2.0, **TIGHT)
    found = [(j.name, j.t, j.u_after[12]) for j in jumps_of(result)]
    expected = [("force upper", 0.5, -1.5), ("force lower", 1.5, 1.125)]
    assert [x[0] for x in found] == [x[0] for x in expected]
    np.testing.assert_allclose(
        [x[1:] for x in found], [x[1:] for x in expected], rtol=0.0, atol=1e-11
    )
    assert all(entry.ok for entry in result.ledger.values())


@long_in_plain_python
@pytest.mark.parametrize(("e", "v_rest"), [(0.0, 1e-2), (0.5, 1e-2), (0.5, 0.0)])
def test_bounces_end_on_the_spring_of_a_stop(e, v_rest):
    """A ball that bounces to rest stays where the spring carries its weight; with 0 as well."""
    result = dap.simulate(ball("plane_stop", k=1e4, e=e, v_rest=v_rest), t_end=5.0)
    assert result.status == "done"
    assert result.r[-1, 0, 2] == pytest.approx(-2.0 * G / 1e4, abs=1e-8)
    assert abs(result.rd[-1, 0, 2]) < 1e-8
    if e and v_rest:
        assert len(jumps_of(result)) == 1 + int(np.log(1e-2 / V0) / np.log(e))


def test_bounces_without_end_end_with_a_clear_message():
    """Impacts pile up at t = (1 + e) / (1 - e) v0 / g, down to the rounding of positions."""
    words = r"t = 1\.3545\d+ s: force floor comes to rest in contact"
    with pytest.raises(dap.SimulationError, match=words) as error:
        dap.simulate(ball(e=0.5), t_end=5.0)
    result = error.value.result
    assert result.ledger["energy"].ok


def test_a_contact_that_stays_and_that_nothing_carries_is_refused():
    """e = 0: the ball would fall through the floor."""
    with pytest.raises(dap.SimulationError, match=r"force floor .* nothing carries it"):
        dap.simulate(ball(e=0.0), t_end=1.0)


@long_in_plain_python
def test_balls_that_touch_without_a_load_cost_no_steps():
    """Two of five fly into three; all touch, and rounding opens and closes their gaps."""
    scene = dap.Scene(name="row")
    for k in range(5):
        x, v = (k - 0.5, 1.0) if k < 2 else (float(k), 0.0)
        scene.add_body(f"b{k}", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(x, 0.0, 0.0), r_dot=(v, 0.0, 0.0))
    for k in range(4):
        ends = {"P_i": f"b{k}.O", "P_j": f"b{k + 1}.O"}
        scene.add_force("ptp_stop", l_stop=1.0, e=1.0, k=1e3, **ends)
    result = dap.simulate(scene, t_end=1.0)
    np.testing.assert_allclose(result.rd[-1, :, 0], [0.0, 0.0, 0.0, 1.0, 1.0], atol=1e-11)
    assert jumps_of(result)[0].t == pytest.approx(0.5, abs=1e-13)
    assert result.stats.rhs < 30_000  # 10_000; without a band of rounding there is no end


def test_a_driver_that_moves_a_body_into_a_stop_is_refused():
    """The joint prescribes the velocity: no impulse can change it."""
    scene = dap.Scene(name="driven")
    scene.add_body("block", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="ground.x")
    scene.add_function("a", "speed", coeff=(0.0, -1.0, 0.0))
    scene.add_joint("drive-tran", "drive", body_i="block", P_i="block.O", P_j="ground.O",
                    a_j="ground.x", function="speed")  # fmt: skip
    scene.add_point("post", body="ground", sPp=(-1.0, 0.0, 0.0))
    scene.add_force("ptp_stop", "stop", P_i="block.O", P_j="post", l_stop=0.5, k=1e4, e=0.5)
    with pytest.raises(dap.SimulationError, match=r"force stop cannot change the velocity"):
        dap.simulate(scene, t_end=1.0)


def test_a_result_file_keeps_its_jumps(tmp_path):
    result = dap.simulate(ball(e=E), t_end=1.0)
    result.save(tmp_path / "run.nc")
    assert open_result(tmp_path / "run.nc").events == result.events


def test_an_event_may_watch_what_jumps():
    """The vertical speed passes zero upwards in the impact, downwards at the top."""
    event = dap.Event("ball.rd.z", at=0.0, name="turns")
    result = dap.simulate(ball(e=E), t_end=1.0, events=[event], **TIGHT)
    (t0, _, v0), _ = impacts(2)
    found = [(x.t, x.direction) for x in result.events if x.name == "turns"]
    assert [x[1] for x in found] == [1, -1]
    assert [x[0] for x in found] == pytest.approx([t0, t0 + v0 / G], abs=1e-11)


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_elements_reset_their_states(integrator):
    """A counter of the passages downwards; both switches cross at one instant."""
    scene = dap.Scene(name="counted")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_force("weight", "gravity", gravity=G)
    scene.add_force("test-bounce", "floor", P_i="ball.O", e=E)
    scene.add_force("test-counter", "counter", P_i="ball.O", count_0=2.0)
    compiled = dap.compile(scene, registry=JUMPING)
    result = dap.simulate(compiled, t_end=2.0, integrator=integrator, **TIGHT)
    table = impacts(3)
    passed = np.searchsorted(table[:, 0], result.t, side="right")
    np.testing.assert_array_equal(result.quantity("counter.count").values, 2.0 + passed)
    sums = np.concatenate([[0.0], np.cumsum(E * table[:, 1])])  # after the impulse of the round
    np.testing.assert_allclose(result.quantity("counter.z_sum").values, sums[passed], atol=1e-11)
    assert [j.name for j in jumps_of(result)] == ["force floor, force counter"] * 3
    assert jumps_of(result)[1].states["counter"]["count"] == 4.0


@pytest.mark.parametrize("method", ["standard", "lsq"])
def test_velocities_follow_a_driver_whose_state_is_reset(method):
    """The row stays met: w = w_0 until t_1, w_1 from then on; the drive does the work."""
    scene = dap.Scene(name="driven")
    scene.add_body("disc", mass=1.0, Jp=(1.0, 1.0, 2.0), w=(0.0, 0.0, 1.0))
    scene.add_joint("test-speed-drive", "drive", body_i="disc", a_j="ground.z", w_0=1.0, t_1=0.3,
                    w_1=4.0)  # fmt: skip
    compiled = dap.compile(scene, registry=JUMPING, method=method)
    result = dap.simulate(compiled, t_end=1.0, dt=0.2, **TIGHT)
    np.testing.assert_allclose(result.w[:, 0, 2], [1.0, 1.0, 4.0, 4.0, 4.0, 4.0], atol=1e-12)
    (jump,) = jumps_of(result)
    assert jump.work == pytest.approx(0.5 * 2.0 * (16.0 - 1.0), rel=1e-12)
    assert jump.states == {"drive": {"w": 4.0}}
    assert result.ledger["energy"].value < 1e-12
    assert result.ledger["velocity"].ok


def pendulums(method="auto"):
    """Two bars, hinged to ground and to each other, in line along x and at rest."""
    scene = dap.Scene(name="bars")
    for k, name in enumerate(("first", "second")):
        scene.add_body(name, mass=2.0 - k, Jp=(0.2, 0.2, 0.3), r=(0.5 + k, 0.0, 0.0))
        scene.add_point(f"near_{name}", body=name, sPp=(-0.5, 0.0, 0.0))
        scene.add_point(f"far_{name}", body=name, sPp=(0.5, 0.0, 0.0))
    axes = {"a_i": "second.z", "a_j": "first.z"}
    scene.add_joint("rev", "elbow", P_i="near_second", P_j="far_first", **axes)
    axes = {"a_i": "first.z", "a_j": "ground.z"}
    scene.add_joint("rev", "shoulder", P_i="near_first", P_j="ground.O", **axes)
    return dap.compile(scene, registry=JUMPING, method=method)


def bars_mass_matrix():
    """Of the angles of both bars against x, in line: T = q_dot M q_dot / 2."""
    m1, m2, J = 2.0, 1.0, 0.3
    return np.array([[J + m1 * 0.25 + m2, m2 * 0.5], [m2 * 0.5, J + m2 * 0.25]])


@long_in_plain_python
def test_an_event_near_an_open_stop_leaves_that_alone():
    """A bar between two stops is set to another speed; the next impact is where that leads."""
    kick = dap.Event("t", above=0.1, action=lambda state: state.set("bar", w=(None, None, -9.0)))
    result = dap.simulate(swinging(), t_end=0.2, events=[kick])
    (found,) = result.events
    assert found.u_after[-1] == pytest.approx(-9.0, abs=1e-12)


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "lsq", "penalty", "joint"])
def test_an_event_sets_velocities_and_the_joints_hold(method):
    """The tip of the second bar gets 3 m/s across by an impulse at its centre and a moment there.

    Both are of the least energy: of M q_dot+ = A^T P, A q_dot+ = given, with the lines A of the
    velocity across and the angular velocity of the second bar.
    """
    given = np.array([1.0, 4.0])  # of the centre across, m/s, and rad/s

    def strike(state):
        state.set("second", r_dot=(None, given[0], None), w=(None, None, given[1]))

    event = dap.Event("t", above=0.25, action=strike, name="strike")
    result = dap.simulate(pendulums(method), t_end=0.5, dt=0.25, events=[event], **TIGHT)
    (found,) = result.events
    A = np.array([[1.0, 0.5], [0.0, 1.0]])
    rates = np.linalg.solve(A, given)
    assert (found.kind, found.u_after[-1]) == ("change", pytest.approx(given[1], abs=1e-12))
    w = np.array(found.u_after)[[14 + 5, 14 + 11]]
    np.testing.assert_allclose(w, rates, rtol=0.0, atol=1e-12)
    assert found.work == pytest.approx(0.5 * rates @ bars_mass_matrix() @ rates, rel=1e-12)
    assert result.ledger["energy"].value < (1e-8 if method == "penalty" else 1e-11)  # its springs
    assert result.ledger["velocity"].ok


def test_a_moment_alone_turns_both_bars_as_the_mass_matrix_says():
    """The shoulder's bar is set to 2 rad/s: no impulse acts on the other, M_21 w1 + M_22 w2 = 0."""
    event = dap.Event("t", above=0.1, action=lambda s: s.set("first", w=(None, None, 2.0)))
    result = dap.simulate(pendulums(), t_end=0.2, events=[event], **TIGHT)
    M = bars_mass_matrix()
    w = np.array(result.events[0].u_after)[[19, 25]]
    np.testing.assert_allclose(w, [2.0, -2.0 * M[1, 0] / M[1, 1]], rtol=0.0, atol=1e-12)


def test_an_event_sets_states_and_velocities_follow():
    """The speed of the drive is its state; the disc turns with it from then on."""
    scene = dap.Scene(name="driven")
    scene.add_body("disc", mass=1.0, Jp=(1.0, 1.0, 2.0), w=(0.0, 0.0, 1.0))
    scene.add_joint("test-speed-drive", "drive", body_i="disc", a_j="ground.z", w_0=1.0, t_1=9.0,
                    w_1=4.0)  # fmt: skip
    event = dap.Event("t", above=0.5, action=lambda state: state.set("drive", w=3.0))
    compiled = dap.compile(scene, registry=JUMPING)
    result = dap.simulate(compiled, t_end=1.0, dt=0.2, events=[event], **TIGHT)
    np.testing.assert_allclose(result.w[:, 0, 2], [1.0, 1.0, 1.0, 3.0, 3.0, 3.0], atol=1e-12)
    np.testing.assert_array_equal(result.quantity("drive.w").values, [1.0] * 3 + [3.0] * 3)
    (found,) = result.events
    assert found.changes == {"drive": {"w": 3.0}}
    assert found.work == pytest.approx(0.5 * 2.0 * (9.0 - 1.0), rel=1e-12)
    assert result.ledger["energy"].value < 1e-12


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_an_event_sets_inputs_and_velocities_follow(method):
    """A driven speed, which jumps with its input, and a force; results have the inputs as set."""
    scene = dap.Scene(name="driven")
    for name in ("speed", "thrust"):
        scene.add_input(name, value=1.0)
    scene.add_body("disc", mass=1.0, Jp=(1.0, 1.0, 2.0), w=(0.0, 0.0, -1.0))
    scene.add_joint("rev", "axle", P_i="disc.O", P_j="ground.O", a_i="disc.z", a_j="ground.z")
    scene.add_joint("rel-rot", "drive", body_i="disc", a_j="ground.z", input="speed")
    scene.add_body("sledge", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(5.0, 0.0, 0.0))
    scene.add_force("f", "engine", body_i="sledge", f=(1.0, 0.0, 0.0), input="thrust")

    def act(state):
        state.set("speed", value=3.0)
        state.set("thrust", value=4.0)

    event = dap.Event("t", above=0.5, action=act)
    result = dap.simulate(scene, method=method, t_end=1.0, dt=0.2, events=[event], **TIGHT)
    np.testing.assert_array_equal(result.quantity("thrust").values, [1.0] * 3 + [4.0] * 3)
    sense = np.sign(result.w[0, 0, 2])
    w = sense * result.w[:, 0, 2]
    np.testing.assert_allclose(w, [1.0, 1.0, 1.0, 3.0, 3.0, 3.0], atol=1e-12)
    assert result.rd[-1, 1, 0] == pytest.approx(0.5 * 0.5 + 2.0 * 0.5, abs=1e-12)
    assert result.events[0].work == pytest.approx(0.5 * 2.0 * (9.0 - 1.0), rel=1e-12)
    assert result.ledger["energy"].value < 1e-12


def test_a_state_of_another_length_is_refused():
    scene = dap.Scene(name="counted")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_force("test-counter", "counter", P_i="ball.O")
    event = dap.Event("t", above=0.1, action=lambda state: state.set("counter", count=(1.0, 2.0)))
    with pytest.raises(
        ValueError, match=r"counter\.count = \(1\.0, 2\.0\) should be a finite number"
    ):
        dap.simulate(dap.compile(scene, registry=JUMPING), t_end=1.0, events=[event])


@long_in_plain_python
@pytest.mark.parametrize(
    ("name", "fields", "words"),
    [
        ("first", {"r_dot": (1.0, 0.0, 0.0)}, "the joints do not allow"),
        ("first", {"w": (1.0, 2.0)}, "three finite numbers"),
        ("first", {"w": (1.0, np.inf, 0.0)}, "three finite numbers"),
        ("first", {"mass": 2.0}, "an event sets r_dot and w of a body"),
        ("frist", {"w": (1.0, 0.0, 0.0)}, "did you mean 'first'"),
        ("zzz", {"w": (1.0, 0.0, 0.0)}, "there are .*first"),
    ],
)
def test_velocities_that_cannot_be_set_are_refused(name, fields, words):
    event = dap.Event("t", above=0.1, action=lambda state: state.set(name, **fields))
    with pytest.raises((dap.SimulationError, ValueError), match=words):
        dap.simulate(pendulums(), t_end=0.2, events=[event])


@long_in_plain_python
def test_a_sweep_over_restitution_gives_what_single_runs_give():
    values = [0.3, 0.9]
    swept = dap.sweep(bouncing(), {"forces.floor.e": values}, outputs="ball.r.z", t_end=1.0,
                      threads=1)  # fmt: skip
    for k, e in enumerate(values):
        single = dap.simulate(bouncing(e=e), t_end=1.0)
        assert swept["ball.r.z"].values[k] == single.r[-1, 0, 2]


@long_in_plain_python
def test_the_error_of_a_run_with_jumps_is_estimated():
    """Loosely: within a factor of 100 of the error against the closed form, and not zero."""
    result = dap.simulate(swinging(), t_end=2.5, rtol=1e-6, estimate_error=True)
    exact = dap.simulate(swinging(), t_end=2.5, **TIGHT)
    error = np.abs(result.r - exact.r)[:, 0].max()
    estimate = result.error.r[:, 0].max()
    assert len(jumps_of(result)) > 1
    assert error / 100.0 < estimate < 100.0 * error
