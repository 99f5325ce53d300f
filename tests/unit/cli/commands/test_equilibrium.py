"""``dap3d equilibrium --over``: its table, its JSON, its picture, and what it refuses."""

import functools
import json

import numpy as np
import pytest
from support.plain import long_in_plain_python
from unit.simulation.equilibrium.test_continuation import reach
from unit.study.test_equilibrium_path import truss, truss_load, turning_height

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.simulation.equilibrium import continuation
from dap3d_core.study.equilibrium_path import equilibrium_path

pytestmark = long_in_plain_python


@functools.cache
def path_of_truss(parameter, values):
    return equilibrium_path(truss(), parameter, values)


def known(scene, parameter, values, **_):
    return path_of_truss(parameter, values)


@pytest.fixture
def model(tmp_path, monkeypatch):
    """The truss in the current folder; its path is followed once for all tests."""
    monkeypatch.chdir(tmp_path)
    path_of_truss("forces.load.f.z", "60:-60:5")
    monkeypatch.setattr(dap, "equilibrium_path", known)
    truss().save("truss.toml")
    return ["equilibrium", "truss.toml", "--over", "forces.load.f.z=60:-60:5"]


def test_json(model, capsys):
    """All points, with marks and quantities of each."""
    assert main([*model, "--of", "node.r.z", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    z = np.array(data["quantities"]["node.r.z"])
    np.testing.assert_allclose(data["values"], truss_load(z), atol=1e-9)
    turns = np.array(data["values"])[data["turning"]]
    np.testing.assert_allclose(turns, truss_load(turning_height() * np.array([1.0, -1.0])))
    assert data["end"] == "reached"
    assert len(data["stable"]) == len(data["given"]) == len(z)


def test_table_fits_sixty_columns(model, capsys, monkeypatch):
    """Given values and turning points, with the coordinate that changes most; a picture."""
    monkeypatch.setenv("COLUMNS", "60")
    assert main([*model, "-o", "curve.png"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 60
    words = [line.split() for line in lines]
    assert ["-42.9143", "0.27788", "unstable", "turns"] in words
    assert ["0", "0", "unstable"] in words
    assert sum(line[-1:] == ["stable"] for line in words) == 8
    assert "-42.914326 N, 42.914326 N" in " ".join(" ".join(words_) for words_ in words)
    assert main([*model, "-o", "curve.png"]) == 2  # it exists


def test_path_that_returns(model, capsys):
    """It is no failure; a note says how to go on."""
    model[-1] = "forces.load.f.z=0:-60:3"
    assert main(model) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "back at the first value" in out
    assert "values that begin beyond it follow the path further" in out


def test_path_that_ends_on_its_way(tmp_path, capsys, monkeypatch):
    """What was found is printed; the exit code is that of a run that stopped early."""
    monkeypatch.setattr(continuation, "SHORTEST_STEP", 1e-2)
    reach().save(tmp_path / "reach.toml")
    over = ["--over", "points.pin.sPp.x=0.6:1.2:4"]
    assert main(["equilibrium", str(tmp_path / "reach.toml"), *over]) == 3
    assert "where no step goes on" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--of", "nod.r.z"), "did you mean 'node.r.z'"),
        (("-o", "path.toml"), ".png"),
        (("--over", "forces.load.f.q=0:1:3"), "did you mean 'forces.load.f"),
    ],
)
def test_what_is_refused(model, words, said, capsys):
    """One message, exit status 2."""
    first = model[:2] if "--over" in words else model
    assert main([*first, *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_picture_without_a_path_is_refused(model, capsys, tmp_path):
    """A scene is not written into a file of a picture's name."""
    assert main([*model[:2], "-o", "curve.png"]) == 2
    assert "give --over PARAMETER=FROM:TO:N" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "curve.png").exists()
