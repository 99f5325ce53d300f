"""Runs that start from the state of a result, or at rest."""

import numpy as np
import pytest
from support import at_rest, problems
from support.ended import shorten_chunks
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import ResultError
from dap3d_core.simulation.initial.start_state import start_state

pytestmark = long_in_plain_python
SHORT = {"t_end": 0.4, "dt": 0.02, "rtol": 1e-11, "atol": 1e-13}


@pytest.fixture(scope="module")
def swing():
    """A pendulum and its result."""
    scene = at_rest.pendulum(1.0)
    return scene, dap.simulate(scene, **SHORT)


def test_two_runs_in_a_row_are_one(swing):
    """The second starts where the first ends; both are exact to their tolerance. Angular velocities
    go to body axes and back, two rotations of 2.6 rad/s: six roundings of each term."""
    scene, first = swing
    whole = dap.simulate(scene, **SHORT | {"t_end": 0.8})
    second = dap.simulate(scene, start=first, **SHORT)
    assert second.t[0] == 0.0
    assert second.u[0] == pytest.approx(first.u[-1], abs=4e-15)
    assert second.u[-1] == pytest.approx(whole.u[-1], abs=1e-8)
    assert any("t = 0.4 s" in note for note in second.notes)


def test_a_reported_instant_is_taken_as_it_is(swing):
    scene, result = swing
    model = dap.compile(scene)
    state = start_state((result, 0.1), model.model, model.checked)
    assert np.array_equal(state.u, result.u[5])
    assert not state.is_interpolated


def test_between_instants_the_state_is_interpolated_to_fifth_order(swing):
    """Half the reporting step, 1/2^6 of the error of positions: some 60 times less."""
    scene, _ = swing
    exact = dap.simulate(scene, **SHORT | {"t_end": 0.17, "dt": 0.17}).u[-1]
    model = dap.compile(scene)
    errors = []
    for dt in (0.1, 0.05):  # 0.17 is at 0.7 and 0.4 of a step, where the error is alike
        result = dap.simulate(scene, **SHORT | {"dt": dt})
        state = start_state((result, 0.17), model.model, model.checked)
        errors.append(np.max(np.abs(state.u - exact)[:7]))
    assert errors[0] < 1e-5
    assert 30 < errors[0] / errors[1] < 130


def test_an_interpolated_state_is_brought_onto_the_constraints(swing):
    """Even where the scene leaves its own start uncorrected; its velocities are of the rows."""
    scene, result = swing
    found = dap.simulate(scene, start=(result, 0.173), correct=False, **SHORT)
    assert found.arrays.position_residual[0] < 1e-10
    assert found.arrays.velocity_residual[0] < 1e-10
    assert any("interpolated" in note for note in found.notes)


def test_bodies_are_matched_by_name_whatever_their_order():
    """The two free bodies in reverse order, and one of them gone."""
    scene = at_rest.ball()
    scene.add_body("moon", mass=2.0, Jp=(0.2, 0.2, 0.2), r=(1.0, 2.0, 3.0), w=(0.0, 0.0, 1.0))
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    other = dap.Scene(name="other")
    for name in ("moon", "ball"):
        other.add_body(name, mass=1.0, Jp=(0.1, 0.1, 0.1))
    found = dap.simulate(other, start=result, t_end=0.0)
    assert np.array_equal(found.r[0], result.r[-1, ::-1])
    assert np.array_equal(found.w[0], result.w[-1, ::-1])
    alone = dap.simulate(at_rest.ball(), start=result, t_end=0.0)
    assert np.array_equal(alone.r[0, 0], result.r[-1, 0])
    assert any("does not have: moon" in note for note in alone.notes)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (3.0, r"should be a result"),
        ("equilibrum", r"did you mean 'equilibrium'"),
        (("result", 1.0), r"should be a result"),
        (lambda result: (result, 9.0), r"from t = 0 s to 0.4 s"),
        (lambda result: (result, -1e-9), r"from t = 0 s to 0.4 s"),
        (lambda result: (result, float("nan")), r"a number of seconds"),
        (lambda result: (result, "end"), r"a number of seconds"),
    ],
)
def test_what_is_no_start_is_refused(swing, start, words):
    scene, result = swing
    with pytest.raises(dap.SceneError, match=words) as error:
        dap.simulate(scene, start=start(result) if callable(start) else start, **SHORT)
    assert [m.key for m in error.value.mistakes] == ["start"]


def test_a_result_of_another_scene_is_refused_with_the_nearest_names(swing):
    other = at_rest.ball()
    other.bodies["rood"] = other.bodies.pop("ball")
    other.bodies["rood"].name = "rood"
    with pytest.raises(dap.SceneError, match=r"no body rood \(nearest: rod\); its bodies are rod"):
        dap.simulate(other, start=swing[1], **SHORT)


def test_a_run_started_at_rest_stays_there_and_can_be_repeated():
    """By the setting of the scene; the record holds it. Lengths of the rod from 0.8 to 1.4 give
    drifts of 3e-14 to 2e-13, as the last digits of the pose have it."""
    scene = at_rest.toggle(1.2)
    scene.simulation.start = "equilibrium"
    result = dap.simulate(scene, **SHORT)
    assert np.max(np.abs(result.u - result.u[0])) < 1e-12
    assert result.settings["start"] == "equilibrium"
    assert dap.rerun(result).equal
    by_hand = dap.simulate(at_rest.toggle(1.2), start=dap.equilibrium(at_rest.toggle(1.2)), **SHORT)
    assert np.array_equal(by_hand.u, result.u)


def test_what_a_script_had_set_is_named_and_the_scene_keeps_its_numbers():
    """An input held by steps, and a number that an event set."""
    scene = at_rest.ball()
    scene.add_input("thrust", value=0.5)
    scene.add_force("f", "jet", body_i="ball", f=(1.0, 0.0, 0.0), input="thrust")
    run = dap.start(scene)
    run.step(0.1, inputs={"thrust": 3.0})
    found = dap.simulate(scene, start=run.result(), t_end=0.1)
    assert found.inputs.tolist() == [[0.5]] * len(found.t)
    assert any("others: thrust (3.0, here 0.5)" in note for note in found.notes)
    gust = dap.Event("ball.r.z", at=scene.bodies["ball"].r[2] - 0.1,
                     action=lambda state: state.set("jet", f=(9.0, 0.0, 0.0)))  # fmt: skip
    changed = dap.simulate(scene, t_end=0.5, events=[gust])
    after = dap.simulate(scene, start=changed, t_end=0.1)
    assert any("jet.f ([9.0, 0.0, 0.0], here [1.0, 0.0, 0.0])" in note for note in after.notes)
    before = dap.simulate(scene, start=(changed, changed.t[1]), t_end=0.1)
    assert not any("others" in note for note in before.notes)


@pytest.mark.slow
def test_a_joint_that_has_broken_stays_so(tmp_path):
    """Through two further runs and a checkpoint; a scene in which it cannot be so is refused."""
    rod = dap.Scene(name="rod")
    rod.add_body("bob", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    rod.add_point("hook", "bob", (-1.0, 0.0, 0.0))
    rod.add_force("weight", "gravity", gravity=9.81)
    rod.add_joint("sph", "rod", P_i="hook", P_j="ground.O", breaks_at=40.0)
    first = dap.simulate(rod, t_end=1.0)
    second = dap.simulate(rod, start=first, t_end=0.1)
    third = dap.simulate(rod, start=second, t_end=0.1)
    assert np.array_equal(third.u[0], second.u[-1])
    fallen = first.r[-1, 0] + 0.2 * first.rd[-1, 0] - [0.0, 0.0, 0.5 * 9.81 * 0.2**2]
    assert third.r[-1, 0] == pytest.approx(fallen, abs=1e-12)
    assert [(e.kind, e.name, e.t) for e in third.events] == [("break", "rod", 0.0)]
    assert not any("redundant" in note for note in third.notes)
    before = dap.simulate(rod, start=(first, 0.3), t_end=0.2)
    (broken,) = before.events
    assert broken.t == pytest.approx(first.events[0].t - 0.3, abs=1e-6)

    def progress(t, t_end):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as error:
        dap.simulate(rod, start=first, t_end=0.1, progress=progress, output=tmp_path / "run.nc",
                     checkpoint=float("inf"))  # fmt: skip
    assert np.array_equal(dap.resume(error.value.checkpoint).u, second.u)
    firm = rod.copy()
    del firm.joints["rod"].fields["breaks_at"]
    with pytest.raises(dap.SceneError, match="joint rod does not hold there"):
        dap.simulate(firm, start=first, t_end=0.1)


def test_no_equilibrium_is_no_run():
    scene = at_rest.ball()
    with pytest.raises(dap.SimulationError, match="no equilibrium") as error:
        dap.simulate(scene, start="equilibrium", **SHORT)
    assert error.value.result is None


def test_a_run_from_a_result_says_that_it_cannot_be_repeated(swing):
    scene, result = swing
    with pytest.raises(ResultError, match="start it from there again"):
        dap.rerun(dap.simulate(scene, start=result, **SHORT))


def test_a_run_from_a_result_goes_on_from_its_checkpoint(tmp_path, monkeypatch):
    """Bit for bit, the start interpolated and corrected."""
    shorten_chunks(monkeypatch)
    scene = problems.four_bar()
    first = dap.simulate(scene, t_end=0.3, dt=0.1)
    whole = dap.simulate(scene, start=(first, 0.123), t_end=0.4, dt=0.1)

    def progress(t, t_end):
        if t > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as error:
        dap.simulate(scene, start=(first, 0.123), t_end=0.4, dt=0.1, progress=progress,
                     output=tmp_path / "run.nc", checkpoint=float("inf"))  # fmt: skip
    assert np.array_equal(dap.resume(error.value.checkpoint).u, whole.u)


def test_points_of_a_sweep_start_at_rest():
    """Each at its own: a weight on a spring sinks by m g / k, and stays."""
    scene = at_rest.ball()
    scene.add_joint("tran", P_i="ball.O", P_j="ground.O", a_j="ground.z")
    scene.add_point("top", "ground", (0.0, 0.0, 1.0))
    scene.add_force("ptp", P_i="ball.O", P_j="top", k=100.0, l0=1.0)
    found = dap.sweep(scene, {"bodies.ball.mass": [1.0, 2.0]}, start="equilibrium", t_end=0.1,
                      outputs=["ball.r.z:min", "ball.r.z:max"])  # fmt: skip
    for name in ("ball.r.z:min", "ball.r.z:max"):
        expected = [-m * at_rest.G / 100.0 for m in (1.0, 2.0)]
        assert found[name].values == pytest.approx(expected, rel=1e-12)
