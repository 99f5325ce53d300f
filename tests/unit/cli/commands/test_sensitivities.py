"""``dap3d sensitivities``: its table, its JSON, its files, and what it refuses."""

import json

import numpy as np
import pytest
import xarray
from support.command_line import lines_of
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.cli import main

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
G, T, V0 = 9.81, 0.5, 2.0


@pytest.fixture
def model(tmp_path, monkeypatch):
    """A stone thrown upwards, in the current folder."""
    monkeypatch.chdir(tmp_path)
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(0.0, 0.0, V0))
    scene.add_force("weight", "gravity", gravity=G)
    scene.simulation.t_end = T
    scene.save("stone.toml")
    return ["sensitivities", "stone.toml", "--by", "forces.gravity.gravity",
            "--by", "bodies.stone.r_dot.z"]  # fmt: skip


def test_json(model, capsys):
    """Derivatives at the end, and elasticities, of z = v t - g t^2 / 2."""
    assert main([*model, "--of", "stone.r.z", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["by"] == ["forces.gravity.gravity", "bodies.stone.r_dot.z"]
    [one] = data["of"]
    z, expected = V0 * T - 0.5 * G * T * T, np.array([-0.5 * T * T, T])
    assert one["value"] == pytest.approx(z, rel=1e-12)
    np.testing.assert_allclose(one["derivatives"], expected, rtol=1e-11)
    np.testing.assert_allclose(one["elasticities"], expected * [G, V0] / z, rtol=1e-11)


@pytest.mark.slow
def test_table_fits_sixty_columns(model):
    """By default the position of the last body; of what is zero there is no elasticity."""
    lines = lines_of(*model, "-o", "stone.png")
    assert any(line.startswith("stone.r.z = -0.22625 m") for line in lines)
    assert any("####" in line for line in lines)
    assert main([*model, "-o", "stone.png"]) == 2  # it exists


@pytest.mark.slow
def test_file(model):
    """Quantities and derivatives over time."""
    assert main([*model, "--of", "stone.r.z", "-o", "stone.nc"]) == 0
    with xarray.open_dataset("stone.nc", engine="netcdf4") as data:
        t = data.time.values
        np.testing.assert_allclose(data["d stone.r.z"].values[:, 0], -0.5 * t * t, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--by", "bodies.stone.mas"), "did you mean 'bodies.stone.mass'"),
        (("--of", "stone.r"), "take stone.r.x"),
        (("--of", "stone.r.q"), "stone.r has x, y, z"),
        (("-o", "stone.docx"), "write .nc, or a figure"),
    ],
)
def test_what_is_refused(model, words, said, capsys):
    """One message, exit status 2."""
    assert main([*model, *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
