"""``dap3d modes``: its table, its JSON, its files, and what it refuses."""

import json

import numpy as np
import pytest
from support.command_line import lines_of

import dap3d_core as dap
from dap3d_core.cli import main

PENDULUM = """
[scene]
name = "rod"
[bodies.rod]
mass = 1.0
Jp = [0.08333333333333333, 0.08333333333333333, 0.001]
r = [0.0, 0.0, -0.5]
[points.top]
body = "rod"
sPp = [0.0, 0.0, 0.5]
[joints.hinge]
type = "rev"
P_i = "top"
P_j = "ground.O"
a_i = "rod.y"
a_j = "ground.y"
[forces.gravity]
type = "weight"
"""


@pytest.fixture
def model(tmp_path, monkeypatch):
    """A hanging rod in the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rod.toml").write_text(PENDULUM)
    return "rod.toml"


def test_json(model, capsys):
    """One object with eigenvalues as pairs, frequencies, damping and stability."""
    assert main(["modes", model, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["stable"] is True
    assert data["dof"] == 1
    np.testing.assert_allclose(data["eigenvalues"], [[0, 14.715**0.5], [0, -(14.715**0.5)]],
                               rtol=1e-12, atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(data["frequencies"], [14.715**0.5 / (2 * np.pi)])
    np.testing.assert_allclose(data["damping"], [0.0], atol=1e-12)
    assert data["modes"][0]["bodies"] == {"rod": 1.0}


def test_table_fits_sixty_columns(model):
    """The table has frequency, damping, eigenvalue and the body that moves, in 60 columns."""
    lines = lines_of("modes", model)
    assert any(line.split() == ["1", "0.61052", "0", "±", "3.836i", "rod"] for line in lines)
    assert any("stable" in line for line in lines)


def test_files(model, tmp_path):
    """The picture of the eigenvalues; the motion of a mode as a result that opens again."""
    assert main(["modes", model, "--plot", "e.png", "-o", "mode.nc"]) == 0
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")
    motion = dap.open("mode.nc")
    assert np.ptp(motion.r[:, 0, 0]) > 0.01
    assert "mode 1 of a linearisation" in " ".join(motion.notes)
    assert main(["modes", model, "--plot", "e.png"]) == 2  # it exists


def test_from_a_result(model, capsys):
    """--from takes the state of a result, at its last instant or at a given one."""
    dap.simulate(model, t_end=1.0, dt=0.5).save("run.nc")
    for start, t in (("run.nc", 1.0), ("run.nc@0.5", 0.5)):
        assert main(["modes", model, "--from", start, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["t"] == t


def test_over_a_parameter(model, capsys):
    """--over follows the mode: sqrt(g l m / J) of a rod whose mass and inertia vary."""
    words = ["modes", model, "--over", "bodies.rod.mass=1:3:3"]
    assert main([*words, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    m = np.array([1.0, 2.0, 3.0])
    exact = np.sqrt(9.81 * 0.5 * m / (1 / 12 + 0.25 * m)) / (2.0 * np.pi)
    np.testing.assert_allclose(np.array(data["frequencies"])[:, 0], exact, rtol=1e-12)
    lines = lines_of(*words, "--plot", "campbell.png")
    assert any(line.split() == ["1", "0.61052", "0.66879", "0", "0"] for line in lines)
