"""A long run that is killed leaves what it had reported."""

import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from support.process import environment

import dap3d_core as dap


@pytest.mark.slow
def test_a_killed_run_leaves_a_readable_part(tmp_path):
    """SIGKILL in the middle: NAME.part opens, its rows are whole and start at t = 0."""
    command = [
        sys.executable,
        "-m",
        "dap3d_core.cli",
        "run",
        "pen1",
        "--t-end",
        "2e4",
        "--dt",
        "0.1",
    ]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    part = tmp_path / "pen1.nc.part"
    rows, deadline = 0, time.monotonic() + 120
    while rows <= 10 and time.monotonic() < deadline:
        time.sleep(0.5)
        if part.exists():  # it is locked while its run goes on; a copy is not
            rows = len(dap.open(shutil.copy(part, tmp_path / "copy.nc")).t)
    process.kill()
    process.wait()
    assert not (tmp_path / "pen1.nc").exists()
    result = dap.open(part)
    assert result.status == "interrupted"
    assert len(result.t) > 10
    assert result.t[0] == 0.0
    assert np.allclose(np.diff(result.t), 0.1)
    assert np.all(np.isfinite(result.u))
