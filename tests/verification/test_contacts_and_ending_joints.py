"""Contacts in scenes whose joints break or hold at times, against closed forms.

At rtol 1e-12 a run of a second leaves less than 1e-12 of its coordinates; a bound of 1e-9 leaves
room for the slowest integrator.
"""

import numpy as np
import pytest

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-13}
g = 9.81


def test_a_ball_that_is_let_go_bounces():
    scene = dap.Scene(name="drop")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.2, 0.25), r=(0.0, 0.0, 1.0))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_point("eye", "ground", (0.0, 0.0, 1.0))
    scene.add_joint("sph", "hand", P_i="ball.O", P_j="eye", active="t < 0.2")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.4, mu=0.3, e=0.5)
    result = dap.simulate(scene, t_end=0.8, dt=0.2, **TIGHT)
    ends, impact = result.events[:2]
    fall = np.sqrt(2.0 * 0.6 / g)
    assert (ends.kind, ends.t, impact.kind) == ("break", 0.2, "impact")
    assert impact.t == pytest.approx(0.2 + fall, abs=1e-12)
    after = 0.8 - impact.t
    height = 0.4 + 0.5 * g * fall * after - 0.5 * g * after**2
    assert result.r[-1, 0, 2] == pytest.approx(height, abs=1e-9)
    assert result.ledger["energy"].ok


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
@pytest.mark.parametrize(("mu", "mode"), [(0.5, 2), (0.05, 1)])
def test_a_ball_on_a_slope_rolls_or_slides_from_the_instant_it_is_let_go(integrator, mu, mode):
    """While the hand holds it the slope carries nothing: what it would push is not determined."""
    slope = np.deg2rad(20.0)
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    scene = dap.Scene(name="slope")
    scene.add_body("ball", mass=2.0, Jp=(0.008, 0.008, 0.008), r=0.1 * normal)
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_vector("n", "ground", normal)
    scene.add_point("place", "ground", 0.1 * normal)
    scene.add_joint("sph", "hand", P_i="ball.O", P_j="place", active="t < 0.25")
    scene.add_contact("ball_plane", "slope", P_i="ball.O", radius=0.1, a_j="n", mu=mu)
    result = dap.simulate(scene, t_end=1.0, dt=0.25, integrator=integrator, **TIGHT)
    rate = 5.0 / 7.0 * np.sin(slope) if mode == 2 else np.sin(slope) - mu * np.cos(slope)
    gone = np.linalg.norm(result.r[:, 0] - result.r[0, 0], axis=1)
    assert np.abs(gone - 0.5 * g * rate * np.maximum(result.t - 0.25, 0.0) ** 2).max() < 1e-9
    contact = result.contact("slope")
    assert contact.mode.tolist() == [0, 0, mode, mode, mode]
    load = 2.0 * g * np.cos(slope) * (result.t > 0.25 - 1e-9)
    assert contact.normal_force[[0, 2, 3, 4]] == pytest.approx(load[[0, 2, 3, 4]], abs=1e-9)


@pytest.mark.parametrize("ahead", [0.3, -0.3])
def test_a_bar_that_slides_on_the_floor_is_caught(ahead):
    """A hook ahead would turn it into the floor, which stops it; one behind lifts it.

    Momentum about the hook: 2 3 0.5 = (0.4 + 2 (0.5^2 + 0.3^2)) w.
    """
    scene = dap.Scene(name="caught")
    scene.add_body("bar", mass=2.0, Jp=(0.3, 0.4, 0.3), r=(0, 0, 0.2), r_dot=(3, 0, 0))
    scene.add_point("foot", "bar", (0.0, 0.0, -0.2))
    scene.add_point("eye", "bar", (ahead, 0.0, 0.5))
    scene.add_point("hook", "ground", (1.0 + ahead, 0.0, 0.7))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_joint("sph", "latch", P_i="eye", P_j="hook", active="bar.r.x >= 1")
    scene.add_joint("planar", "plane", P_i="bar.O", P_j="ground.O", a_i="bar.y", a_j="ground.y")
    scene.add_contact("ball_plane", "floor", P_i="foot", mu=0.0, e=0.0)
    result = dap.simulate(scene, t_end=0.4, dt=0.1, **TIGHT)
    engaged, other = result.events[1:3]
    rate = 3.0 / (0.4 + 2.0 * 0.34)
    left = 0.5 * (0.4 + 2.0 * 0.34) * rate**2
    assert engaged.work == pytest.approx(left - 9.0, abs=1e-9)
    assert engaged.t == other.t == pytest.approx(1.0 / 3.0, abs=1e-12)
    if ahead > 0.0:
        assert other.kind == "impact"
        assert other.work == pytest.approx(-left, abs=1e-9)
        assert np.abs(result.rd[-1]).max() < 1e-12
    else:
        assert other.kind == "lift"
        assert other.u[-2] == pytest.approx(-rate, abs=1e-12)
        assert result.w[-1, 0, 1] < -1.0
    assert result.ledger["energy"].ok


def test_a_clutch_turns_a_wheel_that_friction_holds():
    """1.5 kg m^2 at -2 rad/s and 0.5 at rest: -1.5 rad/s, which 0.6 N m brake in 5 s."""
    scene = dap.Scene(name="clutch")
    for name, inertia, z, rate in (("first", 0.5, 0.0, 0.0), ("second", 1.5, 1.0, -2.0)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, inertia), r=(0.0, 0.0, z), w=(0, 0, rate))
        scene.add_point(f"{name}_seat", "ground", (0.0, 0.0, z))
        scene.add_joint("rev", f"axle_{name}", P_i=f"{name}.O", P_j=f"{name}_seat",
                        a_i=f"{name}.z", a_j="ground.z")  # fmt: skip
    scene.add_force("rot_friction", "rub", joint="axle_first", n_c=0.6)
    scene.add_joint("rel-rot", "clutch", body_i="first", body_j="second", a_j="second.z",
                    active="t > 0.5")  # fmt: skip
    result = dap.simulate(scene, t_end=8.0, dt=0.5, **TIGHT)
    assert [event.kind for event in result.events] == ["engage", "slip", "stick"]
    assert result.events[0].work == pytest.approx(-0.5 * 0.375 * 4.0, abs=1e-12)
    assert result.events[2].t == pytest.approx(5.5, abs=1e-9)
    braked = np.minimum(0.0, -1.5 + 0.3 * (result.t - 0.5))
    later = result.t > 0.5
    assert np.abs(result.w[later, :, 2] - braked[later, None]).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_rod_that_holds_a_block_on_a_slope_breaks_under_a_growing_load(integrator):
    """It carries m g sin(a) + 10 t: the block then slides down without friction."""
    slope, mass, limit = np.deg2rad(30.0), 2.0, 14.0
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    scene = dap.Scene(name="held block")
    scene.add_body("block", mass=mass, Jp=(0.1, 0.1, 0.1))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_vector("n", "ground", normal)
    scene.add_vector("way", "ground", down)
    scene.add_point("peg", "ground", -0.5 * down)
    scene.add_function("a", "pull", coeff=(0.0, 10.0, 0.0))
    scene.add_force("f", "load", body_i="block", f=down, function="pull")
    scene.add_joint("sph-sph", "rod", P_i="block.O", P_j="peg", length=0.5, breaks_at=limit)
    scene.add_contact("ball_plane", "slope", P_i="block.O", a_j="n", mu=0.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, integrator=integrator, **TIGHT)
    breaks = (limit - mass * g * np.sin(slope)) / 10.0
    event = next(event for event in result.events if event.kind == "break")
    assert event.t == pytest.approx(breaks, abs=1e-12)
    s = np.maximum(result.t - breaks, 0.0)
    gone = 0.5 * limit / mass * s**2 + 10.0 / mass * s**3 / 6.0
    assert np.abs(result.r[:, 0] - gone[:, None] * down).max() < 1e-9
    assert result.contact("slope").normal_force == pytest.approx(mass * g * np.cos(slope), abs=1e-9)


def test_an_event_sets_velocities_beside_contacts():
    """A ball at rest on the floor is hit: down it bounces, e = 0.5, and sideways it slides."""
    scene = dap.Scene(name="hit")
    scene.add_body("ball", mass=2.0, Jp=(0.008, 0.008, 0.008), r=(0.0, 0.0, 0.1))
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3, e=0.5)

    def hit(state):
        state.set("ball", r_dot=(0.0, 0.0, -4.0))

    event = dap.Event("t", above=0.1, action=hit)
    result = dap.simulate(scene, t_end=0.4, dt=0.1, events=[event], **TIGHT)
    kinds = [one.kind for one in result.events]
    assert kinds == ["touch", "change", "impact", "lift"]
    assert result.events[1].work == pytest.approx(16.0, abs=1e-12)
    assert result.events[2].work == pytest.approx(-12.0, abs=1e-12)
    flown = 2.0 * 0.3 - 0.5 * g * 0.3**2
    assert result.r[-1, 0, 2] == pytest.approx(0.1 + flown, abs=1e-9)
    assert result.ledger["energy"].ok


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_crane_picks_up_a_box_that_rests_on_its_corners(mu):
    """A rope that is no shorter yet holds the box, too: rounding is all that presses on corners.

    From t = 1 on the tension of the winch is weight and inertia of both.
    """
    scene = dap.Scene(name="crane")
    scene.add_body("hook", mass=20.0, Jp=[0.1] * 3, r=[6.0, 0.0, 2.0])
    scene.add_body("box", mass=400.0, Jp=[60.0] * 3, r=[6.0, 0.0, 0.5])
    top = scene.add_point("top", "ground", [6.0, 0.0, 10.0])
    lug = scene.add_point("lug", "box", [0.0, 0.0, 1.5])
    scene.add_function("b", "wind", x_start=1.0, x_end=3.0, f_end=-2.0)
    scene.add_joint("cable", "winch", points=[top, "hook.O"], function="wind")
    scene.add_joint("sph", "grab", P_i="hook.O", P_j=lug, active="t > 0.5")
    scene.add_contact("box_plane", "floor", body_i="box", size=[1.0, 1.0, 1.0], mu=mu)
    scene.add_force("weight", "g")
    result = dap.simulate(scene, t_end=2.0, dt=0.5)
    assert not any(event.kind == "impact" for event in result.events)
    u = np.clip((result.t - 1.0) / 2.0, 0.0, 1.0)
    height = 2.0 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    up = 2.0 * 60.0 * u * (1.0 - 3.0 * u + 2.0 * u**2) / 2.0**2
    assert result.r[:, 1, 2] == pytest.approx(0.5 + height, abs=1e-9)
    tension = np.abs(result.reaction("winch")["i"].force[:, 2])
    lifted = result.t > 1.0
    assert tension[lifted] == pytest.approx(420.0 * (g + up[lifted]), rel=1e-9)
    assert tension[0] == pytest.approx(20.0 * g)
