"""Runs that end early: what was computed is kept, and the exit code says how it ended."""

import signal

import pytest

import dap3d_core as dap


def _stop(dap3d, number):
    """Send a signal to a long run once it shows progress; its exit code and messages."""
    process = dap3d.start("run", "pen1", "--t-end", "1e5", "--dt", "1", DAP3D_PLAIN="1")
    lines = []
    for line in process.stderr:
        lines.append(line)
        if "left" in line:
            break
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, "".join(lines) + err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "status"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 3, "stopped")],
)
def test_signals_keep_what_was_computed(dap3d, number, code, status):
    found, out, err = _stop(dap3d, number)
    assert found == code, err
    assert "Traceback" not in err
    assert "what was computed" in err
    assert "pen1.nc" in out
    result = dap.open(dap3d.folder / "pen1.nc")
    assert result.status == status
    assert 0.0 < result.t[-1] < 1e5
    assert list(result.t) == [float(k) for k in range(len(result.t))]  # no chunk is lost


@pytest.mark.slow
def test_an_interrupt_before_the_run_leaves_nothing(dap3d):
    """Ctrl-C while packages are still imported, some of which swallow it."""
    for name in ("click", "numpy", "dap3d_core.result"):
        process = dap3d.start(
            "run", "pen1", "--t-end", "1e6", "--dt", "10", PYTHONPROFILEIMPORTTIME="1"
        )
        while line := process.stderr.readline():
            if line.rpartition("|")[2].strip() == name:
                break
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 130, err
        assert "interrupted" in err
        assert "Traceback" not in err
