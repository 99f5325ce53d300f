"""Closed chains from files of others: their motion against minimal coordinates."""

import functools

import numpy as np
import pytest
from support.closed_chains import CHAINS
from support.model_files import mjcf, sdf, urdf

import dap3d_core as dap

WRITERS = {"sdf": sdf, "xml": mjcf, "urdf": urdf}
TIMES = np.linspace(0.0, 0.5, 11)


@functools.cache
def motion_of(name):
    """Of a chain: its mass centres at TIMES, and its files."""
    motion, joints = CHAINS[name]()
    poses = motion.poses(motion.start)
    wanted = ("sdf", "xml", "urdf") if name == "four-bar" else ("sdf", "xml")
    return motion.centres(TIMES), {s: WRITERS[s](motion.bodies, poses, joints) for s in wanted}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "suffix"),
    [(name, suffix) for name in CHAINS for suffix in ("sdf", "xml")] + [("four-bar", "urdf")],
)
def test_a_closed_chain_moves_as_in_minimal_coordinates(tmp_path, name, suffix):
    """Over half a second from rest, of four to 13 bodies; both integrate to 1e-9 or less a step."""
    expected, files = motion_of(name)
    path = tmp_path / f"chain.{suffix}"
    path.write_text(files[suffix])
    scene, report = dap.import_model(path)
    assert not report.left_out
    result = dap.simulate(scene, t_end=0.5, dt=0.05, rtol=1e-10, atol=1e-12)
    assert max(np.ptp(centres, axis=0).max() for centres in expected.values()) > 0.02  # it moves
    for body, centres in expected.items():
        found = result.r[:, list(scene.bodies).index(body)]
        np.testing.assert_allclose(found, centres, rtol=0, atol=1e-6, err_msg=body)
