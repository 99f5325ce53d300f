"""``dap3d response``: its table, its JSON, its picture, and what it refuses."""

import json

import numpy as np
import pytest
from support.command_line import lines_of
from unit.simulation.linearization.test_state_matrices import exact, masses

from dap3d_core.cli import main


@pytest.fixture
def model(tmp_path, monkeypatch):
    """Two masses in the current folder."""
    monkeypatch.chdir(tmp_path)
    masses().save("masses.toml")
    return ["response", "masses.toml", "--input", "push", "--output", "b.r.x"]


def test_json(model, capsys):
    """The response at every frequency, and its peaks, as maxima of the closed form are."""
    assert main([*model, "--from", "0.5", "--to", "5", "-n", "20", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    [one] = data["responses"]
    f, G = np.array(data["frequencies"]), np.array(one["real"]) + 1j * np.array(one["imag"])
    assert f[0] == pytest.approx(0.5)
    assert f[-1] == pytest.approx(5.0)
    np.testing.assert_allclose(G, exact(f)[:, 1], rtol=1e-9)
    assert [p["frequency"] for p in one["peaks"]] == pytest.approx([1.124927, 2.261835], rel=5e-5)


def test_table_fits_sixty_columns(model):
    """The gain at the lowest frequency, and each peak."""
    lines = lines_of(*model, "--output", "a.r.x", "-o", "bode.png")
    assert any("b.r.x over push" in line for line in lines)
    assert any(line.split()[:2] == ["1.1249", "0.37734"] for line in lines)
    assert main([*model, "-o", "bode.png"]) == 2  # it exists
