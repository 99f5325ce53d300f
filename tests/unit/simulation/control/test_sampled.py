"""Controllers in a run: when they are called, what they set, what is refused."""

import numpy as np
import pytest
from support.plain import long_in_plain_python
from support.pushed import feedback, held, pushed_block

import dap3d_core as dap
from dap3d_core.result import ResultError
from dap3d_core.simulation import CheckpointError


def run(update, scene=None, every=0.1, t_end=1.0, **more):
    controllers = [dap.Controller(every=every, update=update)]
    options = {"t_end": t_end, "dt": 0.1, "controllers": controllers} | more
    return dap.simulate(scene or pushed_block(), **options)


@long_in_plain_python
@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "adams", "radau"])
def test_results_are_those_of_a_zero_order_hold(integrator):
    """To rounding: positions are quadratic in a hold, which every method integrates exactly."""
    result = run(feedback, every=0.002, integrator=integrator)
    wanted = held(0.002, 500, keep=50)
    for name, column in (("block.r.x", 0), ("block.rd.x", 1), ("push", 2)):
        assert result.quantity(name).values == pytest.approx(wanted[:, column], abs=5e-15)
    assert result.rdd[:, 0, 0] == pytest.approx(wanted[:, 2] / 2.0, abs=5e-15)


@pytest.mark.parametrize(("integrator", "step"), [("rk4", 0.001), ("rk4", 0.3), ("dopri5", 0.003)])
def test_fixed_steps_end_at_samples_too(integrator, step):
    """Whether they divide the time between two samples, are shorter or longer."""
    result = run(feedback, every=0.002, integrator=integrator, step=step)
    wanted = held(0.002, 500, keep=50)
    assert result.quantity("block.r.x").values == pytest.approx(wanted[:, 0], abs=1e-14)
    assert result.stats.steps <= 1002  # two to a hold, and the last


def test_no_sample_is_missed_and_python_is_called_at_samples_alone():
    """At every multiple of each ``every``, once, before the end; both where two coincide."""
    times = {"slow": [], "fast": []}
    scene = pushed_block()
    scene.add_input("other")
    scene.add_force("n", body_i="block", n=(0.0, 0.0, 1.0), input="other")
    names = {"slow": "push", "fast": "other"}

    def controller(which, every):
        def update(t, state):
            times[which].append((t, state.t))
            return {names[which]: t}

        return dap.Controller(every=every, update=update)

    result = dap.simulate(
        scene, t_end=0.9, dt=0.1, controllers=[controller("slow", 0.03), controller("fast", 0.02)]
    )
    for which, every, count in (("slow", 0.03, 30), ("fast", 0.02, 45)):
        given, state = np.array(times[which]).T
        assert given == pytest.approx(every * np.arange(count), abs=1e-12)
        assert np.max(np.abs(given - state)) < 1e-12
    wanted = 0.02 * np.floor(result.t / 0.02 + 1e-9)
    wanted[-1] = 0.88  # there is no sample at the end
    assert result.quantity("other").values == pytest.approx(wanted, abs=1e-12)
    # 60 holds: 0.02, 0.03, 0.04, 0.06 and so on; the first steps of a run are shorter
    assert 60 <= result.stats.steps < 70


def test_inputs_of_a_controller_act_on_reports_at_its_samples():
    """Acceleration, reaction and input of a report at a sample are those behind it."""
    result = run(lambda t, state: {"push": 1.0 if t >= 0.5 else -1.0})
    wanted = np.where(result.t > 0.45, 1.0, -1.0)
    assert result.quantity("push").values.tolist() == wanted.tolist()
    assert result.rdd[:, 0, 0] == pytest.approx(0.5 * wanted)
    assert result.force("force").on["i"].force[:, 0] == pytest.approx(wanted)
    expression = pushed_block()
    expression.add_output("power", "push * block.rd.x")
    result = run(feedback, expression)
    assert result.quantity("power").values == pytest.approx(
        result.quantity("push").values * result.rd[:, 0, 0], abs=1e-15
    )


def test_what_is_not_returned_stays():
    """A controller sets what it returns; {} leaves all as they are."""
    result = run(lambda t, state: {"push": 2.0} if t == 0.0 else {}, pushed_block(5.0))
    assert result.quantity("push").values.tolist() == [2.0] * 11
    assert result.quantity("block.rd.x").values[-1] == pytest.approx(1.0, abs=1e-14)


def test_a_run_begins_with_the_inputs_of_the_scene():
    """Also behind another run of the same compiled model, and one that failed."""
    compiled = dap.compile(pushed_block(0.5))
    plain = dap.simulate(compiled, t_end=1.0, dt=0.5)
    run(feedback, compiled)
    with pytest.raises(dap.SimulationError):
        run(lambda t, state: {"push": 1.0 / (0.5 - t)} if t != 0.5 else 1 / 0, compiled)
    again = dap.simulate(compiled, t_end=1.0, dt=0.5)
    assert np.array_equal(plain.u, again.u)
    assert again.quantity("push").values.tolist() == [0.5] * 3


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ({"pusch": 1.0}, "there is no input 'pusch'; did you mean 'push'"),
        ({"push": float("nan")}, "input push is set to nan; it should be a finite number"),
        ({"push": "fast"}, "input push is set to 'fast'; it should be a finite number"),
        (None, "returned None at t = 0.3 s; it should return {input: value}"),
        (3.0, r"returned 3\.0 at t = 0\.3 s"),
        ({1: 2.0}, "there is no input 1; inputs of the scene: push"),
    ],
)
def test_what_makes_no_sense_ends_the_run(returned, words):
    """One clear message with the time; what was computed stays."""
    with pytest.raises(dap.SimulationError, match=words) as caught:
        run(lambda t, state: returned if t > 0.25 else {"push": 1.0})
    result = caught.value.result
    assert result.t == pytest.approx([0.0, 0.1, 0.2], abs=1e-12)
    assert result.status == "stopped"


def test_an_exception_of_a_controller_is_reported_with_its_time():
    """It is the cause of the error, and what was computed stays."""

    def broken(t, state):
        return {} if t < 0.55 else {"push": 1.0 / (state["block.r.y"])}

    with pytest.raises(dap.SimulationError, match=r"broken failed at t = 0\.6 s: Zero") as caught:
        run(broken)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert caught.value.result.t[-1] == pytest.approx(0.5)


def test_two_controllers_cannot_set_one_input():
    """They are named."""

    def one(t, state):
        return {"push": 1.0}

    def two(t, state):
        return {"push": 2.0}

    with pytest.raises(dap.SimulationError, match="controllers one and two both set input push"):
        dap.simulate(
            pushed_block(), t_end=1.0, dt=0.5,
            controllers=[dap.Controller(every=0.1, update=update) for update in (one, two)],
        )  # fmt: skip


def test_controllers_that_cannot_be_are_refused():
    """With what to do; a second run is none, for a controller may remember the first."""
    with pytest.raises(dap.SimulationError, match=r"no inputs .*declare \[inputs.NAME\]"):
        run(feedback, "pen1")
    with pytest.raises(dap.SceneError, match=r"estimate_error.*with controllers"):
        run(feedback, estimate_error=True)
    one = dap.Controller(every=0.1, update=feedback)
    for given, words in ((one, r"write \[controller\]"),
                         ([feedback], r"a list of dap\.Controller, not ")):  # fmt: skip
        with pytest.raises(TypeError, match=words):
            dap.simulate(pushed_block(), t_end=1.0, controllers=given)


def test_slow_controllers_are_noted():
    """Slower than the reports, for information; and slower than the run."""
    notes = run(feedback, every=0.25).notes
    assert any(
        "feedback is sampled every 0.25 s, less often than results" in note for note in notes
    )
    notes = run(feedback, every=2.0).notes
    assert any("and the run ends at 1 s: at t = 0 alone" in note for note in notes)
    assert not any("feedback" in note for note in run(feedback, every=0.1).notes)


def test_events_are_located_between_samples():
    """And no step passes a sample while they are looked for."""
    seen = []

    def constant(t, state):
        seen.append(t)
        return {"push": 1.0 + t}

    event = dap.Event("block.r.x", above=0.05)
    result = run(constant, every=0.25, events=[event])
    plain = run(constant, every=0.25)
    assert np.max(np.abs(result.u - plain.u)) < 1e-14
    assert seen == pytest.approx([0.0, 0.25, 0.5, 0.75] * 2)
    # x = t^2 / 4 in the first hold, then with 1.25 N: x0 + v0 s + 1.25 s^2 / 4
    s = np.roots([1.25 / 4.0, 0.125, 0.25**2 / 4.0 - 0.05]).max()
    assert result.events[0].t == pytest.approx(0.25 + s, abs=1e-12)


@pytest.mark.every(4)
@long_in_plain_python
@pytest.mark.parametrize("chunk", [0.0, 1.0])
@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_resumed_run_goes_on_to_the_bit(tmp_path, monkeypatch, chunk, integrator):
    """From a checkpoint between two holds, or in the middle of one (chunks of one step)."""
    monkeypatch.setattr("dap3d_core.simulation.control.sampled.CHUNK_SECONDS", chunk)
    if chunk:
        monkeypatch.setattr("dap3d_core.integrators.stepping.hold.WORK_OF_A_CALL", 0)
        monkeypatch.setattr("dap3d_core.integrators.stepping.hold.LEAST_WORK", 0)
    path, calls = tmp_path / "run.nc", [0]
    controllers = [dap.Controller(every=0.07, update=feedback)]
    options = {"t_end": 1.0, "dt": 0.03, "controllers": controllers, "integrator": integrator}
    whole = dap.simulate(spinning_block(), **options)

    def interrupt(t, t_end):
        calls[0] += 1
        if t > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        dap.simulate(
            spinning_block(), output=path, checkpoint=np.inf, progress=interrupt, **options
        )
    assert 0.4 < caught.value.result.t[-1] < 0.7
    with pytest.raises(CheckpointError, match="the run has the controllers"):
        dap.resume(caught.value.checkpoint)
    resumed = dap.resume(caught.value.checkpoint, controllers=controllers)
    assert calls[0] > 5
    for name in ("t", "u", "v_dot", "inputs"):
        assert np.array_equal(getattr(whole, name), getattr(resumed, name)), name


def spinning_block():
    """The block tumbles as well, so that steps are shorter than holds."""
    scene = pushed_block(w=(3.0, 25.0, 4.0))
    scene.bodies["block"].Jp = (1.0, 2.0, 3.0)
    return scene


@pytest.mark.parametrize("joint", ["rel-tran", "rel-rot"])
def test_velocities_jump_where_a_driver_reads_an_input(joint):
    """By impulses, whose work is in the balance; the rate is held to rounding in between."""
    scene = dap.Scene(name="driven")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_body("load", mass=3.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_input("rate")
    scene.add_joint(joint, "drive", body_i="block", body_j="load", a_j="load.z", input="rate")
    result = dap.simulate(
        scene, t_end=1.0, dt=0.1,
        controllers=[dap.Controller(every=0.2, update=lambda t, state: {"rate": 1.0 + t})],
    )  # fmt: skip
    rates = 1.0 + 0.2 * np.floor(result.t / 0.2 + 1e-9)
    rates[-1] = 1.8
    quantity = result.rd if joint == "rel-tran" else result.w
    assert quantity[:, 1, 2] - quantity[:, 0, 2] == pytest.approx(rates, abs=1e-13)
    # the least change in the metric of the masses conserves momentum
    m, J = np.array([2.0, 3.0]), np.array([1.0, 1.0])
    assert quantity[:, :, 2] @ (m if joint == "rel-tran" else J) == pytest.approx(
        np.zeros(11), abs=1e-13
    )
    assert result.energy.kinetic == pytest.approx(result.work, abs=1e-12)


def test_a_controlled_run_is_not_made_again_without_its_script():
    """Its result names what set the inputs."""
    with pytest.raises(ResultError, match="inputs were set by feedback, which its result does not"):
        dap.rerun(run(feedback))
    stepped = dap.start(pushed_block())
    stepped.step(0.1)
    with pytest.raises(ResultError, match="inputs were set by steps of a script"):
        dap.rerun(stepped.result())


def test_reports_within_a_step_wait_for_room(monkeypatch):
    """With a buffer of few rows: those before a sample are made with what acted there."""
    wanted = run(feedback, every=0.25, dt=0.02)
    monkeypatch.setattr("dap3d_core.simulation.run.BUFFER_NUMBERS", 100)
    found = run(feedback, every=0.25, dt=0.02)
    for name in ("t", "u", "v_dot", "inputs"):
        assert np.array_equal(getattr(wanted, name), getattr(found, name)), name


@pytest.mark.parametrize("every", [0.0, -1.0, float("inf"), float("nan"), True, "1"])
def test_every_is_a_positive_time(every):
    """Anything else is refused where it is made."""
    with pytest.raises(ValueError, match=r"every is .*; it should be a positive number of seconds"):
        dap.Controller(every=every, update=lambda t, state: {})


def test_update_is_a_function():
    """A dict, say, is not."""
    with pytest.raises(TypeError, match=r"update is .*; it should be a function of t"):
        dap.Controller(every=0.1, update={"push": 1.0})


def test_title_is_the_name_or_that_of_the_function():
    """A callable object has that of its class."""

    class Pid:
        def __call__(self, t, state):
            return {}

    def law(t, state):
        return {}

    assert dap.Controller(every=1.0, update=law).title == "law"
    assert dap.Controller(every=1.0, update=Pid()).title == "Pid"
    assert dap.Controller(every=1.0, update=law, name="height").title == "height"
