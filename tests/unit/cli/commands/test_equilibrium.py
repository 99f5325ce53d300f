"""``dap3d equilibrium --over``: its table, its JSON, its picture, and what it refuses."""

import functools
import json

import numpy as np
import pytest
from support.command_line import lines_of
from support.plain import long_in_plain_python
from unit.simulation.equilibrium.test_continuation import reach
from unit.study.test_equilibrium_path import pendulum

import dap3d_core as dap
from dap3d_core.cli import main

pytestmark = long_in_plain_python
follow = dap.equilibrium_path


@functools.cache
def path_of_pendulum():
    """Followed once for all tests; it turns at the largest torque and comes back."""
    return follow(pendulum(), "parameters.torque", "0:12:4")


def known(scene, parameter, values, **_):
    if parameter == "parameters.torque":
        return path_of_pendulum()
    return follow(scene, parameter, values)


@pytest.fixture
def words(tmp_path, monkeypatch):
    """A command for the pendulum in the current folder."""
    monkeypatch.chdir(tmp_path)
    pendulum().save("pendulum.toml")
    return ["equilibrium", "pendulum.toml"]


@pytest.fixture
def model(words, monkeypatch):
    monkeypatch.setattr(dap, "equilibrium_path", known)
    return [*words, "--over", "parameters.torque=0:12:4"]


@pytest.mark.slow
def test_json(model, capsys):
    """All points, with marks and quantities of each."""
    assert main([*model, "--of", "bob.r.x", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    x = np.array(data["quantities"]["bob.r.x"])
    np.testing.assert_allclose(data["values"], -2.0 * 9.81 * x, atol=1e-9)
    assert np.array(data["values"])[data["turning"]] == pytest.approx([9.81])
    assert data["end"] == "returned"
    assert len(data["stable"]) == len(data["given"]) == len(x)


@pytest.mark.slow
def test_table_fits_sixty_columns(model):
    """Given values and turning points, with the coordinate that changes most; a picture.
    To return is no failure; a note says how to go on."""
    lines = lines_of(*model, "-o", "curve.png")
    words = [line.split() for line in lines]
    assert ["9.81", "0", "unstable", "turns"] in words
    assert ["8", "0.289382", "unstable"] in words
    assert sum(line[-1:] == ["stable"] for line in words) == 3
    out = " ".join(" ".join(lines).split())
    assert "back at the first value" in out
    assert "values that begin beyond it follow the path further" in out
    assert main([*model, "-o", "curve.png"]) == 2  # it exists


@pytest.mark.slow
def test_path_that_ends_on_its_way(tmp_path, capsys, monkeypatch):
    """What was found is printed; the exit code is that of a run that stopped early."""
    monkeypatch.setattr("dap3d_core.simulation.equilibrium.continuation.SHORTEST_STEP", 1e-2)
    reach().save(tmp_path / "reach.toml")
    over = ["--over", "points.pin.sPp.x=0.6:1.2:4"]
    assert main(["equilibrium", str(tmp_path / "reach.toml"), *over]) == 3
    assert "where no step goes on" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--of", "bab.r.z"), "did you mean 'bob.r.z'"),
        (("-o", "path.toml"), ".png"),
        (("--over", "parameters.torqe=0:1:3"), "did you mean 'parameters.torque"),
        # a scene is not written into a file of a picture's name
        (("-o", "curve.png"), "give --over PARAMETER=FROM:TO:N"),
    ],
)
def test_what_is_refused(words, more, said, capsys, tmp_path):
    """One message, exit status 2."""
    if "--over" not in more and "curve.png" not in more:
        words += ["--over", "parameters.torque=0:1:2"]
    assert main([*words, *more]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "curve.png").exists()
