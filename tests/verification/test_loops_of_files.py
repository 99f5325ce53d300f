"""A closed chain from files of others: its motion against minimal coordinates."""

import numpy as np
import pytest
from support.closed_chains import stewart
from support.model_files import mjcf, sdf

import dap3d_core as dap

WRITERS = {"sdf": sdf, "xml": mjcf}
TIMES = np.linspace(0.0, 0.5, 11)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", WRITERS)
def test_a_platform_moves_as_in_minimal_coordinates(tmp_path, suffix):
    """Over half a second from rest, of 13 bodies; both integrate to 1e-9 or less a step.
    Planar loops of all formats: tests/unit/formats/test_formats.py."""
    motion, joints = stewart()
    expected = motion.centres(TIMES)
    path = tmp_path / f"chain.{suffix}"
    path.write_text(WRITERS[suffix](motion.bodies, motion.poses(motion.start), joints))
    scene, report = dap.import_model(path)
    assert not report.left_out
    result = dap.simulate(scene, t_end=0.5, dt=0.05, rtol=1e-10, atol=1e-12)
    assert max(np.ptp(centres, axis=0).max() for centres in expected.values()) > 0.02  # it moves
    for body, centres in expected.items():
        found = result.r[:, list(scene.bodies).index(body)]
        np.testing.assert_allclose(found, centres, rtol=0, atol=1e-6, err_msg=body)
