"""A report measures errors as it says, keeps failures as words, and recommends what was fastest."""

import csv
import io
import json
import math

import attrs
import numpy as np
import pytest
from support import problems
from support.internals import FIXED_STEP
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.integrators import INTEGRATORS
from dap3d_core.report import MeasuredRun, Report, Setting
from dap3d_core.report.reference import final_position_error, first_parting, trajectory_error
from dap3d_core.report.report import front, recommend
from dap3d_core.report.settings_ladder import ADAPTIVE, MEASURED, ladder, ladder_of_steps

REQUIRED = {"method", "integrator", "time_s", "error", "energy_error", "constraint_error",
            "steps", "rejected", "rhs", "projections"}  # fmt: skip


@pytest.fixture(scope="module")
def small():
    """A report of the pendulum A01 over its first 0.2 s."""
    return dap.report(problems.pendulum(), quick=True, t_end=0.2, dt=0.05, target_error=1e-6)


def states(**changes):
    """Two instants of one body at rest at (2, 0, 0); changes are entries of the second instant."""
    u = np.zeros((2, 13))
    u[:, 0], u[:, 3] = 2.0, 1.0
    for entry, value in changes.items():
        u[1, int(entry[1:])] = value
    return u


# ---------------------------------------------------------------------------- measures


def test_the_error_is_that_of_the_benchmark_library():
    """26 numbers; one off by 0.2 of 2, one by 3e-4 of a zero, which counts as 1e-3."""
    error = trajectory_error(states(_0=2.2, _7=3e-4), states())
    assert error == pytest.approx(math.sqrt((0.1**2 + 0.3**2) / 26), rel=1e-12)


def test_euler_parameters_of_either_sign_are_one_orientation():
    turned = states()
    turned[:, 3:7] = [0.6, 0.8, 0.0, 0.0]
    opposite = turned.copy()
    opposite[1, 3:7] *= -1.0
    assert trajectory_error(opposite, turned) == 0.0
    assert trajectory_error(turned, states()) > 0.1


def test_the_error_of_the_final_position_is_a_distance():
    assert final_position_error(states(_0=2.3, _1=0.4), states()) == pytest.approx(0.5, rel=1e-12)


def test_trajectories_part_where_they_differ_by_a_thousandth_of_the_size():
    t = np.array([0.0, 1.0])
    assert first_parting(t, states(), states(_0=2.0 + 1.9e-3), 1.0) is None
    assert first_parting(t, states(), states(_0=2.0 + 2.1e-3), 1.0) == 1


# ---------------------------------------------------------------------------- ladders


def test_every_integrator_has_a_ladder_from_coarse_to_fine():
    """Those that need a step get steps, all others tolerances with atol = rtol / 100."""
    assert set(ADAPTIVE) | set(FIXED_STEP) == set(INTEGRATORS)
    for name in INTEGRATORS:
        rungs = ladder("standard", name, (1e-6, 1e-3), (0.01, 0.02))
        if name in FIXED_STEP:
            assert [(r.step, r.rtol) for r in rungs] == [(0.02, None), (0.01, None)]
        else:
            assert [(r.rtol, r.atol, r.step) for r in rungs] == [
                (1e-3, 1e-5, None), (1e-6, 1e-8, None),
            ]  # fmt: skip


def test_steps_start_from_the_motion_and_never_exceed_the_reporting_step():
    assert ladder_of_steps(1.0, 0.5, 10, quick=False) == pytest.approx(
        [0.1 / 2**k for k in range(8)], rel=5e-3
    )
    assert max(ladder_of_steps(1.0, 0.02, 10, quick=True)) == 0.02


def test_flags_are_those_of_the_command_line():
    assert Setting("lsq", "dop853", 1e-7, 1e-9).flags == (
        "--method lsq --integrator dop853 --rtol 1e-07 --atol 1e-09"
    )
    assert Setting("lsq", "rk4", step=0.02).flags == "--method lsq --integrator rk4 --step 0.02"


# ---------------------------------------------------------------------------- recommending


def run(integrator, time_s, error, spread=0.0, repeats=5, rhs=1234):
    return MeasuredRun(
        setting=Setting("standard", integrator, 1e-6, 1e-8),
        time_s=time_s, time_min_s=time_s - spread, time_max_s=time_s + spread, repeats=repeats,
        error=error, final_position_error=0.0, energy_error=0.0, constraint_error=0.0,
        constraint_velocity_error=0.0, constraint_acceleration_error=0.0, quaternion_error=0.0,
        counts={"steps": 1, "rejected": 0, "rhs": rhs, "projections": 0},
    )  # fmt: skip


def test_the_front_holds_runs_that_no_faster_one_beats():
    runs = [run("a", 1.0, 1e-3), run("b", 2.0, 1e-2), run("b", 3.0, 1e-6), run("a", 4.0, 1e-9)]
    assert front(runs, None) == {0, 2, 3}
    assert front(runs, 1e-5) == {0, 2}  # below the uncertainty nothing is better


def test_the_fastest_run_that_reaches_the_target_is_recommended():
    runs = [run("a", 1.0, 1e-3), run("b", 3.0, 1e-6), run("a", 2.0, 1e-7, spread=0.1)]
    advice = recommend(runs, 1e-12, 1e-5)
    assert advice.run is runs[2]
    assert "fastest of 2 settings" in advice.reason
    assert "standard, b, rtol 1e-06 at 1.5 times its time" in advice.reason
    assert "spread" not in advice.reason
    assert advice.flags == runs[2].setting.flags


def test_a_difference_within_the_spread_of_the_timings_is_called_so():
    runs = [run("a", 2.0, 1e-7, spread=0.2), run("b", 2.1, 1e-7, spread=0.2)]
    assert "within the spread of the timings" in recommend(runs, None, 1e-5).reason
    once = [run("a", 2.0, 1e-7, repeats=1), run("b", 2.1, 1e-7, repeats=1)]
    assert "each timed once" in recommend(once, None, 1e-5).reason


@pytest.mark.parametrize("timing", [dict(repeats=1), dict(spread=20.0)])
def test_what_timings_cannot_tell_goes_by_evaluations(timing):
    """A run that another program held up is no worse for it: here the one of half the work."""
    made = [(22.0, 1e-3, 440), (51.0, 1e-7, 500), (40.0, 1e-8, 800), (60.0, 1e-9, 1200)]
    runs = [run("a", time_s, error, rhs=rhs, **timing) for time_s, error, rhs in made]
    advice = recommend(runs, None, 1e-5)
    assert advice.run is runs[1]
    assert "takes the least work of 3 settings" in advice.reason


@pytest.mark.parametrize(
    ("timing", "integrator", "time_s", "evaluations"),
    [
        # of radau one costs a factorisation or more: few of them are no sign of little work
        (dict(repeats=1), "b", 30.0, (2000, 300)),
        (dict(spread=1.0), "a", 23.0, (900, 100)),  # timings that can tell
    ],
)
def test_evaluations_do_not_decide(timing, integrator, time_s, evaluations):
    runs = [run(name, t, 1e-7, rhs=rhs, **timing) for name, t, rhs in
            zip(("a", integrator), (20.0, time_s), evaluations, strict=True)]  # fmt: skip
    assert recommend(runs, None, 1e-5).run is runs[0]


@pytest.mark.parametrize("integrator", ["adams", "radau"])
def test_an_integrator_without_fixed_steps_can_be_asked_for(integrator):
    """None of the settings that are tried beforehand gives it a step."""
    found = dap.report(
        problems.pendulum(), quick=True, t_end=0.1, dt=0.1, integrators=[integrator],
        methods=["standard"],
    )  # fmt: skip
    assert {r.integrator for r in found.runs} == {integrator}


def test_a_target_that_cannot_be_reached_or_told_is_said_so():
    runs = [run("a", 1.0, 1e-3), run("b", 2.0, 1e-8)]
    far = recommend(runs, 1e-12, 1e-9)
    assert (far.run, far.flags) == (None, "")
    assert "no setting reaches it" in far.reason
    assert "1.0e-08" in far.reason
    assert "uncertainty of the reference" in recommend(runs, 1e-7, 1e-9).reason
    with pytest.raises(ValueError, match="positive"):
        recommend(runs, None, 0.0)


# ---------------------------------------------------------------------------- whole reports


@long_in_plain_python
def test_every_integrator_is_measured_and_errors_fall_with_the_tolerance(small):
    """Of the pendulum from rest, over 0.2 s; in each ladder the last error is far below the first.
    Three rungs span six decades of tolerance, or a factor of 16 in the step of an order of 4."""
    assert small.status == "done"
    assert not small.failed
    assert {r.integrator for r in small.runs} == set(MEASURED)
    for method, integrator in {(r.method, r.integrator) for r in small.runs} - {
        ("penalty", name) for name in INTEGRATORS  # its passes end at a residual
    }:  # fmt: skip
        errors = [r.error for r in small.runs if (r.method, r.integrator) == (method, integrator)]
        assert len(errors) == 3
        assert errors[-1] < 1e-2 * errors[0] or errors[-1] < 1e-11
    assert [each.method for each in small.refused] == ["unconstrained"]
    assert all("does not fit" in each.reason for each in small.refused)


@long_in_plain_python
def test_the_reference_is_two_runs_that_differ_in_integrator_and_method(small):
    first, second = small.reference.settings
    assert first.integrator != second.integrator
    assert first.method != second.method
    assert small.reference.uncertainty < 1e-11
    assert small.reference.meaningless_from is None
    assert small.reference.expected is None


def test_where_references_part_errors_are_measured_up_to_there(monkeypatch):
    """Here already rounding counts as parting."""
    monkeypatch.setattr("dap3d_core.report.reference.PARTED", 1e-300)
    found = dap.report(
        problems.pendulum(), quick=True, t_end=0.2, dt=0.05, integrators=["rk4"],
        methods=["standard"],
    )  # fmt: skip
    reference = found.reference
    assert 0.0 < reference.meaningless_from <= 0.2
    assert reference.t[-1] < reference.meaningless_from
    assert "errors are measured up to there alone" in reference.notes[0]
    assert found.to_dict()["reference"]["meaningless_from"] == reference.meaningless_from


def test_the_error_is_the_true_one():
    """Free fall, whose closed form explicit methods of order 2 and more give exactly."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=2.0, Jp=(0.1, 0.1, 0.1), r_dot=(0.3, 0.0, 0.0))
    scene.add_force("weight", "gravity")
    found = dap.report(scene, integrators=["rk4"], steps=[0.05], t_end=0.1, dt=0.05, repeat=2)
    (only,) = found.runs
    t, z = found.reference.t, found.reference.u[:, 2]
    assert z == pytest.approx(-9.81 / 2 * t**2, abs=1e-14)  # rounding of 0.05 m
    assert only.error < 1e-12
    assert (only.counts["steps"], only.counts["rhs"], only.repeats) == (2, 8, 2)
    assert only.time_min_s <= only.time_s <= only.time_max_s


def test_json_has_the_keys_of_the_design_and_no_number_that_is_none(small):
    found = json.loads(small.to_json())
    assert len(found["runs"]) == len(small.runs)
    for each in found["runs"]:
        assert each.keys() >= REQUIRED
        assert ("rtol" in each) != ("step" in each)
        numbers = [v for v in each.values() if not isinstance(v, (str, bool))]
        assert all(isinstance(v, (int, float)) and math.isfinite(v) for v in numbers)
        assert each["time_s"] > 0.0
    assert found["recommended"]["target_error"] == 1e-6
    assert found["recommended"]["flags"] == small.recommended().flags
    assert found["refused"][0]["method"] == "unconstrained"


def test_csv_has_a_row_for_each_setting_and_reads_back(small, tmp_path):
    path = small.save_csv(tmp_path / "a.csv")
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert len(rows) == len(small.runs)
    for row, each in zip(rows, small.runs, strict=True):
        assert float(row["error"]) == each.error
        assert float(row["time_s"]) == each.time_s
        assert int(row["rhs"]) == each.counts["rhs"]
        assert row["failed"] == ""
    with pytest.raises(OSError, match="exists"):
        small.save_csv(path)


def test_the_recommended_setting_gives_the_motion_that_was_measured(small):
    """Its options, in ``simulate``, take as many steps; equal runs give equal arrays."""
    advice = small.recommended(1e-6)
    setting = advice.run.setting
    result = dap.simulate(
        problems.pendulum(), method=setting.method, t_end=0.2, dt=0.05, **setting.options
    )
    assert result.stats.rhs == advice.run.counts["rhs"]
    assert trajectory_error(result.u, small.reference.u) == advice.run.error
    assert advice.run.error <= 1e-6


@long_in_plain_python
def test_a_run_that_fails_is_a_row_with_its_reason(monkeypatch):
    """A spring of 1e12 N/m with a fixed step far beyond its period of 6 us: it blows up.
    A rough reference will do."""
    monkeypatch.setattr("dap3d_core.report.reference.TIGHTEST", (1e-5, 1e-4))
    scene = dap.Scene(name="stiff")
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="ground.O", k=1e12, l0=0.99)
    found = dap.report(
        scene, integrators=["rk4", "dop853"], steps=[1e-5], tolerances=[1e-3], t_end=1e-3,
        dt=1e-4, repeat=1,
    )  # fmt: skip
    assert [r.integrator for r in found.runs] == ["dop853"]
    (failed,) = found.failed
    assert (failed.setting.integrator, failed.setting.step) == ("rk4", 1e-5)
    assert "infinite or not a number" in failed.reason
    rows = list(csv.DictReader(io.StringIO(found.to_csv())))
    assert rows[-1]["failed"] == failed.reason
    assert found.to_dict()["failed"][0]["failed"] == failed.reason


def test_a_run_that_takes_too_long_is_ended_and_finer_ones_are_left_out(monkeypatch):
    """A limit below the time of any run; the reference has more patience."""
    monkeypatch.setattr("dap3d_core.report.reference.REFERENCE_LIMIT", 1e9)
    found = dap.report(
        problems.free_body((1, 2, 3), (1, 2, 0.5)), integrators=["rk4"], steps=[1e-3, 5e-4],
        t_end=10.0, dt=5.0, repeat=1, limit_s=1e-7,
    )  # fmt: skip
    assert not found.runs
    assert found.failed[0].reason.startswith("ended after 1e-07 s, at t = ")
    assert found.failed[1].reason == "left out: step 0.001 s took too long"
    assert found.recommended().reason == "no setting came to its end"


@long_in_plain_python
def test_redundant_scenes_refuse_the_standard_method_and_go_on():
    found = dap.report("A04", quick=True, t_end=0.02, dt=0.02, integrators=["dop853"])
    reasons = {each.method: each.reason for each in found.refused}
    assert set(reasons) == {"unconstrained", "standard"}
    assert "redundant" in reasons["standard"]
    assert {r.method for r in found.runs} == {"penalty", "lsq", "joint"}
    assert not found.failed


@long_in_plain_python
def test_expected_numbers_confirm_the_reference_of_a_scene_that_is_as_read():
    """pen1: r.cone and others at t = 1 (models/pen1/expected.toml); a changed scene has none."""
    quick = dict(quick=True, t_end=1.0, dt=1.0, integrators=["dop853"], methods=["standard"])
    expected = dap.report("pen1", **quick).reference.expected
    assert expected.count >= 1
    assert expected.within
    assert expected.deviation < 1e-8
    scene = dap.load("pen1")
    scene.bodies["cone"].mass = 1.5
    assert dap.report(scene, **quick).reference.expected is None


@pytest.mark.parametrize("failing", ["progress", "interrupt"])
def test_what_was_measured_is_kept_when_it_is_ended_early(failing):
    error = KeyboardInterrupt() if failing == "interrupt" else OSError("told to stop")
    calls, measured = [], set()

    def progress(done, total, words):
        calls.append((done, total))
        if words.startswith("standard"):
            measured.add(words)
        if len(measured) > 2:  # so two settings have come to their end, however slow the machine
            raise error

    with pytest.raises(type(error)) as caught:
        dap.report(
            problems.pendulum(), quick=True, t_end=0.1, dt=0.05, methods=["standard"],
            progress=progress,
        )  # fmt: skip
    kept = caught.value.report
    assert isinstance(kept, Report)
    assert kept.status == "interrupted"
    assert 0 < len(kept.runs) < 3 * len(INTEGRATORS)
    assert all(0.0 <= done <= total for done, total in calls)


def test_a_step_of_the_scene_does_not_fix_the_steps_of_adaptive_integrators():
    scene = problems.pendulum()
    scene.simulation = attrs.evolve(scene.simulation, integrator="rk4", step=0.001)
    found = dap.report(scene, integrators=["dop853"], methods=["standard"], t_end=0.1, dt=0.1,
                       tolerances=[1e-3], repeat=1)  # fmt: skip
    assert found.runs[0].counts["steps"] < 20
    assert any("step of 0.001 s is left out" in note for note in found.notes)
    assert scene.simulation.step == 0.001


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        (dict(methods=["standrad"]), dap.SceneError, "did you mean 'standard'"),
        (dict(integrators=["dop85"]), dap.SceneError, "did you mean 'dop853'"),
        (dict(tolerances=[0.0]), dap.SceneError, "rtol"),
        (dict(steps=[-1.0]), dap.SceneError, "step"),
        (dict(t_end=0.0), dap.SceneError, "no motion"),
        (dict(repeat=0), ValueError, "repeat"),
        (dict(target_error=-1.0), ValueError, "target_error"),
    ],
)
def test_settings_that_make_no_sense_are_refused_before_anything_is_run(given, error, words):
    with pytest.raises(error, match=words):
        dap.report(problems.pendulum(), **(dict(t_end=0.1, quick=True) | given))


def test_a_scene_that_cannot_be_assembled_is_an_error():
    """Two pivots that cannot both hold one point: positions that cannot be assembled."""
    scene = problems.pendulum()
    scene.add_point("away", "ground", (5.0, 0.0, 0.0))
    scene.add_joint("sph", "pin", P_i="bob.O", P_j="away")
    with pytest.raises(dap.AssemblyError, match="pin"):
        dap.report(scene, quick=True, t_end=0.1)


def test_a_scene_of_which_no_run_comes_to_its_end_is_an_error_with_reasons(monkeypatch):
    monkeypatch.setattr(
        "dap3d_core.report.measurement.Bench.run", lambda *_, **__: "the step size fell"
    )
    words = r"no run came to its end: .*standard, dop853: the step size fell"
    with pytest.raises(dap.SimulationError, match=words):
        dap.report(problems.pendulum(), quick=True, t_end=0.1)
