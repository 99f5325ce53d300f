"""``dap3d run`` as a user meets it: what it writes, what it says, its exit codes."""

import json
import re

import pytest

import dap3d_core as dap


def test_run_writes_a_result_and_says_what_was_done(dap3d):
    done = dap3d.succeed("run", "pen1", "--t-end", "0.1")
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
    done = dap3d.succeed("run", "fourbar3", "--t-end", "0.1", "--json", "-o", "a.nc")
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


def test_without_a_model_and_without_a_terminal_it_is_a_usage_error(dap3d):
    refused = dap3d("run")
    assert refused.returncode == 2
    assert "MODEL" in refused.stderr
