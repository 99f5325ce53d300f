"""Stiff scenes are noticed by the explicit methods, others are not; auto goes over to radau."""

import numpy as np
import pytest

import dap3d_core as dap

#: A05: height of the slider (benchmarks, section 1).
GOVERNOR = {0.05: 0.506100897244, 0.1: 0.5238364755696, 0.5: 0.7432494247863}


@pytest.fixture(scope="module")
def governor():
    return dap.compile("models/benchmarks/A05")


def stiffness(result):
    return [note for note in result.notes if "have died away" in note]


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
def test_the_governor_is_stiff(governor, integrator, rtol):
    """Its dampers are 1000 times faster than its motion. The finding changes nothing."""
    settings = {"t_end": 0.1, "rtol": rtol, "atol": rtol / 100.0, "integrator": integrator}
    result = dap.simulate(governor, **settings)
    (note,) = stiffness(result)
    assert integrator in note
    assert "radau" in note
    z = result.r[-1, list(result.model.body_names).index("slider"), 2]
    assert z == pytest.approx(GOVERNOR[0.1], abs=rtol)


@pytest.mark.parametrize("rtol", [1e-3, 1e-8])
@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
@pytest.mark.parametrize(
    "model", ["pen1", "pen2", "bodies2", "fourbar3", "benchmarks/A02-1", "benchmarks/A03",
              "benchmarks/A04", "benchmarks/N1"]
)  # fmt: skip
def test_others_are_not(model, integrator, rtol):
    """Pendulums, loops, springs with dampers, singular poses: accuracy limits their steps."""
    scene = dap.load(model if "/" not in model else f"models/{model}")
    t_end = min(scene.simulation.t_end, 2.0)
    settings = {"t_end": t_end, "dt": t_end, "rtol": rtol, "atol": rtol / 100.0}
    assert not stiffness(dap.simulate(scene, integrator=integrator, **settings))


def test_a_motion_that_decays_is_not_stiff_while_it_lasts():
    """A body in a viscous fluid, v = exp(-t / 0.1 s): to 1e-4 m/s accuracy limits the steps."""
    scene = dap.Scene(name="viscous")
    scene.add_body("ball", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "fluid", P_i="ball.O", P_j="ground.O", c=10.0)
    result = dap.simulate(scene, t_end=0.9, dt=0.9, rtol=1e-8, atol=1e-10)
    assert result.rd[-1, 0, 0] == pytest.approx(np.exp(-9.0), abs=1e-8)
    assert not stiffness(result)


def test_slip_that_turns_while_it_vanishes_does_not_make_a_rolling_top_stiff():
    """It does until the top rolls; from there on dop853 takes a fifth of the steps of radau."""
    axis = np.array([np.sin(0.1), 0.0, np.cos(0.1)])
    scene = dap.Scene(name="tippe top")
    scene.add_body("top", mass=0.015, Jp=(2.2e-6, 2.2e-6, 2.5e-6), rpy=(0.0, 0.1, 0.0),
                   r=[0.0, 0.0, 0.02] - 0.003 * axis, w=150.0 * axis)  # fmt: skip
    scene.add_point("centre", "top", (0.0, 0.0, 0.003))
    scene.add_force("weight")
    scene.add_contact("ball_plane", "table", P_i="centre", radius=0.02, mu=0.3)
    result = dap.simulate(scene, t_end=1.0, dt=0.05, rtol=1e-10, atol=1e-12)
    assert [event.kind for event in result.events] == ["touch", "stick"]
    assert not stiffness(result)


@pytest.mark.slow
def test_auto_takes_the_steps_of_radau(governor):
    """Every reporting time once, the digits of the reference, the steps of radau but for the start;
    the work done on the system goes on where it stood."""
    settings = {"t_end": 0.5, "dt": 0.001, "rtol": 1e-7, "atol": 1e-9}
    auto = dap.simulate(governor, integrator="auto", **settings)
    radau = dap.simulate(governor, integrator="radau", **settings)
    slider = list(auto.model.body_names).index("slider")
    assert np.array_equal(auto.t, radau.t)
    for t, z in GOVERNOR.items():
        assert auto.r[round(t / 0.001), slider, 2] == pytest.approx(z, abs=1e-7)
    assert auto.stats.steps < 1.5 * radau.stats.steps
    assert "then radau" in stiffness(auto)[0]
    assert auto.ledger["energy"].ok
    assert auto.status == "done"


def test_auto_is_dop853_where_nothing_is_stiff():
    """Bit for bit."""
    runs = [dap.simulate("pen1", t_end=0.5, integrator=name) for name in ("auto", "dop853")]
    assert np.array_equal(runs[0].u, runs[1].u)
    assert not stiffness(runs[0])


def test_auto_and_penalty_only_say_so(governor):
    """Radau does not solve the equations of penalty, which are stiff by themselves or not."""
    scene = dap.load("models/benchmarks/A05")
    settings = {"t_end": 0.02, "rtol": 1e-5, "atol": 1e-7, "method": "penalty"}
    result = dap.simulate(scene, integrator="auto", **settings)
    (note,) = stiffness(result)
    assert "then radau" not in note


@pytest.mark.slow
def test_an_event_after_the_change_is_found(governor):
    """The slider passes 0.6 m, long after radau has taken over; located on radau's own steps."""
    event = dap.Event("slider.r.z", above=0.6, action="stop")
    settings = {"t_end": 0.5, "rtol": 1e-7, "atol": 1e-9}
    auto = dap.simulate(governor, integrator="auto", events=[event], **settings)
    radau = dap.simulate(governor, integrator="radau", events=[event], **settings)
    assert stiffness(auto)
    assert auto.events[0].t == pytest.approx(radau.events[0].t, abs=1e-7)
    slider = list(auto.model.body_names).index("slider")
    assert auto.r[-1, slider, 2] == pytest.approx(0.6, abs=1e-12)
