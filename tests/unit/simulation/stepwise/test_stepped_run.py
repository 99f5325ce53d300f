"""Runs that a script takes step by step."""

import numpy as np
import pytest
from support.arm import NAMES, arm_scene
from support.plain import long_in_plain_python
from support.process import together
from support.pushed import feedback, held, pushed_block

import dap3d_core as dap


def loop(run, count=100, dt=0.01):
    for _ in range(count):
        run.step(dt, inputs=feedback(run.t, run.state))
    return run.result()


def test_a_loop_of_ones_own_is_the_controller():
    """To rounding: the same zero-order hold."""
    wanted = held(0.01, 100)
    result = loop(dap.start(pushed_block()))
    for name, column in (("block.r.x", 0), ("block.rd.x", 1), ("push", 2)):
        assert result.quantity(name).values == pytest.approx(wanted[:, column], abs=1e-14)
    assert result.t == pytest.approx(0.01 * np.arange(101), abs=1e-12)
    controllers = [dap.Controller(every=0.01, update=feedback)]
    other = dap.simulate(pushed_block(), t_end=1.0, dt=0.01, controllers=controllers)
    assert np.max(np.abs(other.u - result.u)) < 1e-14
    assert np.max(np.abs(other.v_dot - result.v_dot)[:-1]) < 1e-14


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "joint"])
@pytest.mark.parametrize("integrator", ["dop853", "adams", "auto"])
def test_a_reset_run_repeats_itself_to_the_bit(method, integrator):
    """In body and in joint coordinates; and from another state and back."""
    run = dap.start(arm_scene(method), integrator=integrator, rtol=1e-6)

    def motion():
        for k in range(20):
            run.step(0.01, {NAMES[1]: 3.0 * k, NAMES[4]: -0.1 * k})
        return run.result()

    first = motion()
    run.reset(first.u[10])
    assert run.t == 0.0
    assert run.state.u == pytest.approx(first.u[10], abs=1e-9)
    assert run.result().inputs[-1].tolist() == [0.0] * 6
    motion()
    run.reset()
    second = motion()
    for name in ("t", "u", "v_dot", "Lam", "inputs"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


def test_other_runs_of_the_model_do_not_disturb_it():
    """It has arrays of its own; nor does asking for its result."""
    compiled = dap.compile(pushed_block())
    run, plain = dap.start(compiled), dap.start(compiled)
    for k in range(50):
        run.step(0.01, {"push": float(k)})
        plain.step(0.01, {"push": float(k)})
        if k % 10 == 0:
            dap.simulate(compiled, t_end=0.1)
            run.result().force("force")
    assert np.array_equal(run.state.u, plain.state.u)


def test_settings_are_those_of_simulate():
    """Tolerances, steps, the end; the end of the scene is none."""
    scene = pushed_block(1.0)
    scene.simulation.t_end = 0.05
    run = dap.start(scene, integrator="rk4", step=0.005)
    run.step(0.1)
    assert run.result().stats.steps in (20, 21)  # a rounding of time may be left
    assert run.state["block.r.x"] == pytest.approx(0.25 * 0.1**2, abs=1e-15)
    with pytest.raises(dap.SceneError, match="rtol"):
        dap.start(scene, rtol=-1.0)


def test_the_end_of_a_run_is_told():
    """With what was computed, and again until it is reset."""
    run = dap.start(pushed_block(1.0), t_end=0.25)
    for _ in range(5):
        run.step(0.05)  # the last one ends at the end, whatever the rounding
    assert run.t == 0.25
    run.reset()
    run.step(0.1)
    run.step(0.1)
    for _ in range(2):
        with pytest.raises(dap.SimulationError, match=r"reached its end, t = 0\.25 s") as caught:
            run.step(0.1)
    assert caught.value.result.t == pytest.approx([0.0, 0.1, 0.2, 0.25])
    run.reset()
    assert run.step(0.1) == 0.1


def test_a_step_that_fails_says_why_and_keeps_what_was_computed():
    """A spring of negative stiffness: the elongation is half a metre times cosh(200 t)."""
    scene = pushed_block()
    scene.bodies["block"].r = (1.0, 0.0, 0.0)
    scene.add_force("ptp", "spring", P_i="block.O", P_j="ground.O", l0=0.5, k=-80_000.0)
    run = dap.start(scene)

    def go_on():
        for _ in range(100):
            run.step(0.1)

    with pytest.raises(dap.SimulationError, match=r"the run stopped at t = 0\.54") as caught:
        go_on()
    result = caught.value.result
    assert result.status == "stopped"
    assert result.t[:6] == pytest.approx(0.1 * np.arange(6), abs=1e-12)
    wanted = 0.5 + 0.5 * np.cosh(200.0 * result.t[:6])
    assert result.r[:6, 0, 0] == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize(
    ("dt", "inputs", "words"),
    [
        (0.0, None, "dt is 0.0; it should be a positive number"),
        (float("nan"), None, "dt is nan"),
        (-0.1, {"push": 1.0}, "dt is -0.1"),
        (0.1, {"pusch": 1.0}, "there is no input 'pusch'; did you mean 'push'"),
        ("soon", None, "dt is 'soon'; it should be a positive number"),
        (0.1, {"push": None}, "input push is set to None; it should be a finite number"),
        (0.1, [1.0], r"given as \{input: value\}, not as \[1.0\]"),
    ],
)
def test_steps_that_make_no_sense_are_refused(dt, inputs, words):
    """Before anything is done: the run goes on."""
    run = dap.start(pushed_block(1.0))
    with pytest.raises((ValueError, TypeError), match=words):
        run.step(dt, inputs)
    assert run.t == 0.0
    assert run.step(0.1) == 0.1


def test_without_a_record_the_present_state_is_the_result():
    """For runs of any length."""
    run = dap.start(pushed_block(1.0), record=False)
    for _ in range(10):
        run.step(0.1)
    result = run.result()
    assert result.t == pytest.approx([1.0])
    assert result.r[0, 0, 0] == pytest.approx(0.25)


@long_in_plain_python
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_velocities_jump_within_a_step(method):
    """A ball that bounces: instants in closed form, to the rounding of times; and once more."""
    scene = dap.Scene(name="bouncing")
    scene.add_body("ball", r=(0.0, 0.0, 1.0))
    scene.add_force("weight")
    scene.add_force("plane_stop", "floor", P_i="ball.O", P_j="ground.O", a_j="ground.z", e=0.7,
                    k=1e5)  # fmt: skip
    impact = np.sqrt(2.0 / 9.81)
    flights = 2.0 * impact * 0.7 ** np.arange(1, 6)
    run = dap.start(scene, method=method)

    def bounces(count=950):
        for _ in range(count):
            run.step(0.002)
        return run.result()

    first = bounces()
    times = impact + np.cumsum([0.0, *flights])
    assert [event.t for event in first.events] == pytest.approx(times[times < 1.9], abs=1e-12)
    run.reset()
    second = bounces()
    assert np.array_equal(first.u, second.u)
    assert [event.t for event in second.events] == [event.t for event in first.events]
    run.reset(first.u[100])
    assert bounces(150).events[0].t == pytest.approx(impact - 0.2, abs=1e-12)


def test_threads_take_turns_in_a_run():
    """Each step is taken by one thread at a time: the states are those of a single thread."""
    alone = dap.start("pen1")
    for _ in range(60):
        alone.step(0.01)
    shared = dap.start("pen1")

    def work():
        for _ in range(15):
            shared.step(0.01)

    together(*[work] * 4)
    found, wanted = shared.result(), alone.result()
    np.testing.assert_array_equal(found.t, wanted.t)
    np.testing.assert_array_equal(found.u, wanted.u)


@long_in_plain_python
def test_forces_of_stepped_contacts_are_those_of_the_steps():
    """A block of 2 kg that rests bears its weight: in the state, in the record, and to a law.

    They are means of steps, which no state tells.
    """
    scene, weight, seen = pushed_block(r=(0.0, 0.0, 0.1)), 2.0 * 9.81, []
    scene.add_force("weight", "weight")
    scene.add_contact("ball_plane", "floor", P_i="block.O", radius=0.1, mu=0.5)
    run = dap.start(scene, contact="stepping", contact_step=1e-3)
    for _ in range(3):
        run.step(0.01)
        assert run.state["floor.normal"] == pytest.approx(weight, rel=1e-9)
    result = run.result()
    assert result.contact("floor").normal_force == pytest.approx(np.full(4, weight), rel=1e-9)
    assert np.max(np.abs(result.rdd)) < 1e-9
    law = dap.Controller(
        every=0.01, update=lambda t, state: seen.append(state["floor.normal"]) or {}
    )
    dap.simulate(scene, t_end=0.03, contact="stepping", contact_step=1e-3, controllers=[law])
    assert seen == pytest.approx([weight] * 3, rel=1e-9)


@long_in_plain_python
def test_contacts_of_shapes_are_tabled_at_the_end_of_each_step():
    """As in a run that reports there, and anew after a reset."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 0.101))
    scene.add_force("weight", "weight")
    scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_collisions()
    wanted = dap.simulate(scene, t_end=0.1, dt=0.02, contact="stepping").contacts
    run = dap.start(scene, contact="stepping")
    for _ in range(2):
        for _ in range(5):
            run.step(0.02)
        found = run.result().contacts
        assert len(found) == len(wanted) == 5
        assert found.t == pytest.approx(wanted.t)
        assert found.force == pytest.approx(wanted.force, rel=1e-9)
        run.reset()
