"""``dap3d run`` as a user meets it: what it writes, what it says, its exit codes."""

import json
import os
import re

import numpy as np
import pytest
from support.mechanisms import rough_four_bar

import dap3d_core as dap


def test_run_writes_a_result_and_says_what_was_done(dap3d):
    done = dap3d("run", "pen1", "--t-end", "0.1")
    assert done.returncode == 0, done.stderr
    assert dap.open(dap3d.folder / "pen1.nc").t[-1] == 0.1
    for words in (
        "1 body",
        "1 joint (3 rows)",
        "3 degrees of freedom",
        "standard",
        "dop853",
        "right-hand side",
        "energy",
        "pen1.nc written",
        "dap3d plot pen1.nc",
    ):
        assert words in done.stdout
    assert "\x1b" not in done.stdout + done.stderr  # nobody looks at a terminal


@pytest.mark.slow
def test_json_is_one_object_with_the_same_facts(dap3d):
    done = dap3d("run", "fourbar3", "--t-end", "0.1", "--json", "-o", "a.nc")
    assert done.returncode == 0
    found = json.loads(done.stdout)
    expected = {"status": "done", "exit_code": 0, "file": "a.nc", "bodies": 3, "rows": 17, "dof": 1}
    assert {k: found[k] for k in expected} == expected
    assert found["method"] == "standard"
    assert found["ledger"]["position"]["ok"] is True
    result = dap.open(dap3d.folder / "a.nc")
    assert found["steps"] == result.stats.steps
    assert found["notes"] == result.notes
    # the corrected start is that of the result
    assert found["initial"]["changed"]
    assert found["initial"]["bodies"]["crank"]["w"] == result.w[0, 0].tolist()


@pytest.mark.slow
def test_the_corrected_initial_conditions_are_reported(dap3d):
    done = dap3d("run", "fourbar3", "--t-end", "0.05", "--dt", "0.05")
    assert "corrected initial conditions" in done.stdout
    # the motor turns the crank once a second, backwards about x: -2 pi
    assert re.search(r"crank\n.*\n.*\n.*\n +w +-6\.28319", done.stdout), done.stdout
    again = dap3d("run", "fourbar3", "--t-end", "0.05", "--dt", "0.05", "--no-correct", "--force")
    assert "corrected initial" not in again.stdout


@pytest.mark.slow
def test_the_end_may_be_zero(dap3d):
    done = dap3d("run", "pen1", "--t-end", "0", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["instants"] == 1


@pytest.mark.slow
def test_quiet_prints_nothing(dap3d):
    done = dap3d("run", "pen1", "--t-end", "0.1", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.slow
def test_strict_makes_changes_a_failure_and_saves_all_the_same(dap3d):
    """Velocities that the scene leaves open are for information; positions that were corrected by
    a millimetre are a change of what was given."""
    calm = dap3d("run", "pen1", "--t-end", "0.1", "--strict")
    assert calm.returncode == 0, calm.stdout + calm.stderr
    told = dap3d("run", "fourbar3", "--t-end", "0.1", "--strict")
    assert told.returncode == 0, told.stdout + told.stderr
    assert "for information: initial velocities" in told.stdout
    rough_four_bar().save(dap3d.folder / "rough.toml")
    noted = dap3d("run", "rough.toml", "--t-end", "0.1", "--strict")
    assert noted.returncode == 1
    assert "--strict" in noted.stderr
    assert dap.open(dap3d.folder / "rough.nc").status == "done"


@pytest.mark.slow
def test_the_metric_of_the_correction_can_be_chosen(dap3d):
    """The crank of the rough four-bar leaves the vertical by another angle where masses count; the
    choice stands in the result."""
    rough_four_bar().save(dap3d.folder / "rough.toml")
    start = {}
    for metric in ("unit", "mass"):
        done = dap3d("run", "rough.toml", "--t-end", "0", "--correct-metric", metric, "--json",
                     "-o", f"{metric}.nc")  # fmt: skip
        found = json.loads(done.stdout)
        assert found["settings"]["correct_metric"] == metric
        assert found["initial"]["changed_bodies"] == ["crank", "coupler", "follower"]
        start[metric] = np.array(found["initial"]["bodies"]["crank"]["p"])
        checked = dap3d("check", "rough.toml", "--correct-metric", metric, "--json")
        same = json.loads(checked.stdout)["initial"]["bodies"]["crank"]["p"]
        assert start[metric] == pytest.approx(same, abs=1e-12)  # but for the projection's rounding
    assert np.max(np.abs(start["unit"] - start["mass"])) > 1e-5
    assert dap3d("run", "rough.toml", "--correct-metric", "energy").returncode == 2


@pytest.mark.slow
def test_output_that_exists_is_refused_before_running(dap3d):
    (dap3d.folder / "pen1.nc").write_text("mine")
    refused = dap3d("run", "pen1", "--t-end", "0.1")
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    assert (dap3d.folder / "pen1.nc").read_text() == "mine"
    assert dap3d("run", "pen1", "--t-end", "0.1", "--force").returncode == 0
    assert dap.open(dap3d.folder / "pen1.nc").status == "done"


def test_output_that_cannot_be_written_is_refused_before_running(refuse, scene_file):
    scene = scene_file()
    text = scene.read_text()
    for target in ("nowhere/a.nc", "fall.toml/a.nc", ".", "fall.toml", "/dev/full", "x" * 300):
        assert len(refuse("run", "fall.toml", "-o", target, "--force").splitlines()) == 1
    assert scene.read_text() == text


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(dap3d):
    folder = dap3d.folder / "locked"
    folder.mkdir(mode=0o500)
    refused = dap3d("run", "pen1", "-o", "locked/a.nc")
    assert refused.returncode == 2
    assert "permission" in refused.stderr


def test_without_a_model_and_without_a_terminal_it_is_a_usage_error(dap3d):
    refused = dap3d("run")
    assert refused.returncode == 2
    assert "MODEL" in refused.stderr


def test_settings_are_refused_before_compiling_and_by_their_option(refuse):
    for option, value in (("--t-end", "inf"), ("--t-end", "-1"), ("--rtol", "0"), ("--dt", "nan"),
                          ("--atol", "-1"), ("--step", "0"), ("--dt", "100")):  # fmt: skip
        assert refuse("run", "pen1", option, value).startswith(option)
    assert "did you mean 'dop853'" in refuse("run", "pen1", "--integrator", "dop85")
    assert refuse("run", "pen1", "--integrator", "rk4").startswith("--step")
    assert "unconstrained does not fit" in refuse("run", "pen1", "--method", "unconstrained")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "pen1", "--t_end", "1"), "--t-end"),
        (("run", "pen1", "--dt", "0.1", "--dt", "0.2"), "--dt is given more than once"),
        (("run", "pen1", "--correct", "--no-correct"), "more than once"),
        (("run", "pen1", "pen2"), "pen2"),
        (("run", "pen1", "--dt", "1,5"), "1,5"),
        (("run", "pen1", "-o"), "-o"),
        (("rnu", "pen1"), "did you mean 'run'"),
        (("check",), "MODEL"),
        ((), "Commands:"),
    ],
)
def test_usage_errors(refuse, arguments, words):
    assert words in refuse(*arguments)


@pytest.mark.slow
def test_mistakes_of_a_scene_are_all_told_with_place_and_remedy(dap3d, scene_file):
    scene_file(("mass = 2.0", "mas = 2.0"), ('type = "weight"', 'type = "wieght"'))
    refused = dap3d("run", "fall.toml")
    assert refused.returncode == 2
    assert "fall.toml:5: bodies.stone.mas = 2.0" in refused.stderr
    assert "did you mean 'mass'" in refused.stderr
    assert "fall.toml:9: forces.gravity.type" in refused.stderr
    assert "did you mean 'weight'" in refused.stderr
    assert not (dap3d.folder / "fall.nc").exists()
    as_json = dap3d("run", "fall.toml", "--json")
    assert as_json.returncode == 2
    found = json.loads(as_json.stdout)
    assert found["exit_code"] == 2
    assert (found["mistakes"][0]["line"], found["mistakes"][0]["nearest"]) == (5, "mass")


@pytest.mark.slow
def test_a_missing_point_and_a_missing_file(dap3d, scene_file):
    scene_file(("[simulation]", '[joints.J]\ntype = "sph"\nP_i = "tip"\nP_j = "ground.O"\n'
                                "[simulation]"))  # fmt: skip
    refused = dap3d("run", "fall.toml")
    assert refused.returncode == 2
    assert "joints.J.P_i" in refused.stderr
    missing = dap3d("run", "no/such.toml")
    assert missing.returncode == 2
    assert "no/such.toml" in missing.stderr


@pytest.mark.slow
def test_file_names_of_any_kind(dap3d, scene_file):
    for name in ('it\'s a "stone".toml', "-dash.toml", "päper\nclip.toml"):
        scene_file(name=name)
        done = dap3d("run", "--", name)
        assert done.returncode == 0, done.stderr
        assert (dap3d.folder / f"{name.removesuffix('.toml')}.nc").is_file()


@pytest.mark.slow
def test_a_run_that_cannot_be_assembled_leaves_nothing(dap3d, scene_file):
    scene_file(("[simulation]", '[points.P]\nbody = "ground"\nsPp = [0.0, 0.0, 1.0]\n'
                '[joints.J]\ntype = "sph"\nP_i = "stone.O"\nP_j = "ground.O"\n'
                '[joints.K]\ntype = "sph"\nP_i = "stone.O"\nP_j = "P"\n[simulation]'))  # fmt: skip
    failed = dap3d("run", "fall.toml", "--json")
    assert failed.returncode == 1
    assert "J" in failed.stderr
    assert json.loads(failed.stdout)["exit_code"] == 1
    assert not (dap3d.folder / "fall.nc").exists()


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_failure(dap3d):
    dap3d("run", "pen1", "--t-end", "0.1", "-o", "first.nc")  # compiles, where nobody did before
    process = dap3d.start("run", "pen1", "--t-end", "0.1")
    process.stdout.close()
    with process.stderr:
        said = process.stderr.read()
    assert process.wait() == 0
    assert said == ""
    assert dap.open(dap3d.folder / "pen1.nc").status == "done"
