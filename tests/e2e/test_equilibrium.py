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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_run_starts_from_a_result_or_at_rest(dap3d, folder):
    dap3d.succeed("run", "toggle.toml", "--t-end", "0.1", "-o", "a.nc")
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
