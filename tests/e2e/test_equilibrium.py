"""``dap3d equilibrium``, and runs that start at rest or from a result, as a user meets them."""

import json

import numpy as np
import pytest
from support import at_rest

import dap3d_core as dap


@pytest.fixture
def folder(dap3d):
    at_rest.toggle(1.2).save(dap3d.folder / "toggle.toml")
    at_rest.ball().save(dap3d.folder / "ball.toml")
    return dap3d.folder


def test_the_command_prints_poses_and_reactions(dap3d, folder):
    done = dap3d.succeed("equilibrium", "toggle.toml", "-o", "rest.toml")
    for words in ("toggle: stable equilibrium", "1 degree of freedom", "slider", "1.21885",
                  "J4", "rest.toml written"):  # fmt: skip
        assert words in done.stdout
    again = dap3d("equilibrium", "rest.toml", "--json")
    found = json.loads(again.stdout)
    expected = dap.equilibrium(at_rest.toggle(1.2))
    assert found["stable"] is True
    assert found["steps"] <= 1
    assert found["bodies"]["slider"]["r"] == pytest.approx(expected.r[2], abs=1e-15)
    force = found["reactions"]["J1"]["on"]["i"]["force"]
    assert force == pytest.approx(expected.reaction("J1")["i"].force, abs=1e-11)
    assert found["reactions"]["J1"]["unique"] is False  # all links in a plane: one row too many
    assert found["residual"] < 1e-14


def test_a_fall_is_a_message_and_exit_code_1(dap3d, folder):
    done = dap3d("equilibrium", "ball.toml")
    assert done.returncode == 1
    assert "body ball, which moves along -z" in done.stderr
    assert "Traceback" not in done.stderr
    done = dap3d("run", "ball.toml", "--start", "equilibrium", "--t-end", "1")
    assert done.returncode == 1
    assert "no equilibrium" in done.stderr
    assert not (folder / "ball.nc").exists()


def test_a_run_starts_from_a_result_or_at_rest(dap3d, folder):
    assert dap3d("run", "toggle.toml", "--t-end", "0.1", "-o", "a.nc").returncode == 0
    done = dap3d.succeed(
        "run", "toggle.toml", "--from", "a.nc@0.05", "--t-end", "0.05", "-o", "b.nc"
    )
    a, b = dap.open(folder / "a.nc"), dap.open(folder / "b.nc")
    k = int(np.argmin(np.abs(a.t - 0.05)))
    assert b.u[0] == pytest.approx(a.u[k], abs=1e-12)
    assert "the start is the state of toggle at t = 0.05 s" in " ".join(done.stdout.split())
    done = dap3d.succeed(
        "run", "toggle.toml", "--start", "equilibrium", "--t-end", "0.1", "-o", "c.nc"
    )
    assert np.max(np.abs(dap.open(folder / "c.nc").rd)) < 1e-12


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--from", "a.nc@9"], "--from = 9.0: the result reaches from t = 0 s to 0.1 s"),
        (["--from", "a.nc@soon"], "'soon' is no time in s"),
        (["--from", "b.nc"], "b.nc"),
        (["--from", "b.nc@0.1"], "b.nc"),
        (["--from", "toggle.toml"], "toggle.toml"),
        (["--from", "a.nc", "--start", "equilibrium"], "give one"),
        (["--from", "a.nc", "--from", "a.nc"], "more than once"),
        (["--start", "rest"], "'scene', 'equilibrium'"),
        (["--from", "a.nc", "-o", "a.nc", "--force"], "a.nc is the input file"),
        (["--from", ""], "empty word"),
    ],
)
def test_what_is_no_start_is_refused(dap3d, folder, words, message):
    dap3d("run", "toggle.toml", "--t-end", "0.1", "-o", "a.nc")
    given = words if "-o" in words else [*words, "-o", "c.nc"]
    done = dap3d("run", "toggle.toml", "--t-end", "0.1", *given)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not (folder / "c.nc").exists()


def test_a_result_of_another_scene_is_refused(dap3d, folder):
    dap3d("run", "toggle.toml", "--t-end", "0.1", "-o", "a.nc")
    done = dap3d("equilibrium", "toggle.toml", "--from", "a.nc", "-o", "a.nc", "--force")
    assert done.returncode == 2
    assert "a.nc is the input file" in done.stderr
    for command in ("run", "equilibrium"):
        done = dap3d(command, "ball.toml", "--from", "a.nc")
        assert done.returncode == 2
        assert "it is of another scene: it has no body ball" in " ".join(done.stderr.split())


def test_a_scene_may_ask_for_its_equilibrium_and_a_wrong_word_has_its_line(dap3d, folder):
    text = (folder / "toggle.toml").read_text()
    (folder / "rest.toml").write_text(text + '\n[simulation]\nstart = "equilibrium"\nt_end = 0.1\n')
    done = dap3d.succeed("run", "rest.toml")
    assert "starts at an equilibrium" in done.stdout
    (folder / "wrong.toml").write_text(text + '\n[simulation]\nstart = "equilibrum"\nt_end = 0.1\n')
    done = dap3d("run", "wrong.toml")
    assert done.returncode == 2
    assert "simulation.start" in done.stderr
    assert "did you mean 'equilibrium'" in done.stderr
