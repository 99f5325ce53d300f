"""The robots and linkages of models/robots: URDF, SDF and MJCF files that run."""

import numpy as np
import pytest
from support.process import REPOSITORY

import dap3d_core as dap

ROBOTS = REPOSITORY / "models" / "robots"
FILES = sorted(path for path in ROBOTS.iterdir() if path.suffix in (".urdf", ".sdf", ".xml"))


def test_there_are_ten():
    assert len(FILES) == 10


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_robot_runs(path):
    """The ledger closes: energy against the work of all forces, and the joints hold."""
    scene, report = dap.import_model(path)
    assert scene.shapes
    assert not any("no file" in one.text for one in report.left_out)
    result = dap.simulate(scene, t_end=0.3, dt=0.01, rtol=1e-9, atol=1e-11)
    assert all(entry.ok for entry in result.ledger.values())
    assert result.ledger["energy"].value < 1e-7  # some hundred steps of 1e-9


@pytest.mark.slow
def test_the_tip_of_peaucelliers_linkage_moves_on_a_straight_line():
    """Its abscissa is (long^2 - short^2) / (2 crank) = 1.035 m for a crank of 0.25 m."""
    scene, _ = dap.import_model(ROBOTS / "peaucellier.sdf")
    scene.add_point("T", "ta", (0.175, 0.0, 0.0))
    result = dap.simulate(scene, t_end=0.3, dt=0.01, rtol=1e-10, atol=1e-12)
    tip = result.quantity("T.r").values
    assert np.ptp(tip[:, 2]) > 0.1
    # coordinates of the file have ten digits
    np.testing.assert_allclose(tip[:, 0], (0.8**2 - 0.35**2) / 0.5, rtol=0, atol=1e-8)
