"""Energies are drawn on their own scale, and the drift of a conserved one is named."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.plot import plot


@pytest.fixture(scope="module")
def swing():
    """A pendulum: kinetic and potential energy change by the same, their sum by errors alone."""
    return dap.simulate("pen1", t_end=1.0, dt=0.02)


def test_a_conserved_energy_is_level(swing):
    ax = plot(swing, "energy.total")
    exchanged = np.ptp(swing.energy.kinetic)
    assert np.ptp(ax.get_ylim()) == pytest.approx(1.1 * exchanged, rel=1e-6)
    (line,) = ax.get_lines()
    assert np.ptp(line.get_ydata()) < 1e-6 * exchanged
    drift = f"(drift {swing.ledger['total energy'].value:.1g})"
    assert ax.get_ylabel() == f"total energy {drift} [J]"


def test_the_legend_names_the_drift(swing):
    ax = plot(swing, "energy.total", "energy.kinetic")
    total, kinetic = (t.get_text() for t in ax.get_legend().get_texts())
    assert total == f"energy.total (drift {swing.ledger['total energy'].value:.1g})"
    assert kinetic == "energy.kinetic"
    assert "drift" not in plot(swing, "work", "energy.kinetic").get_ylabel()


def test_a_free_body_has_the_scale_of_its_kinetic_energy():
    """Neither energy changes: what is seen otherwise is the error of the run."""
    scene = dap.Scene(name="free")
    scene.add_body("b", Jp=(1.0, 2.0, 3.0), w=(0.1, 5.0, 0.1))
    free = dap.simulate(scene, t_end=1.0, dt=0.05)
    ax = plot(free, "energy.total")
    assert np.ptp(ax.get_ylim()) == pytest.approx(1.1 * free.energy.kinetic[0], rel=1e-6)
    assert ax.get_ylabel() == f"total energy (drift {free.ledger['energy'].value:.1g}) [J]"


def test_an_energy_that_dampers_take_has_no_drift():
    lost = dap.simulate("bodies2", t_end=1.0, dt=0.05)
    ax = plot(lost, "energy.total")
    assert ax.get_ylabel() == "total energy [J]"
    assert np.ptp(ax.get_ylim()) >= np.ptp(lost.energy.potential)
