"""Runs that end early: what was computed is kept, and the exit code says how it ended."""

import json
import signal

import pytest

import dap3d_core as dap

PLUGIN = '''
from dap3d_core.interface import Body, Force, body, hookimpl
from dap3d_core.kernels import sqrt, where

interface_version = 1


class Breaking(Force):
    """Pulls, but between t = 0.05 and 0.2 s: there its number is none."""

    keyword = "breaking"
    body_i: Body = body()

    def wrench(t):
        z = sqrt(where(t < 0.05, 1.0, where(t > 0.2, 1.0, -1.0)))
        return (((0.0, 0.0, z), (0.0, 0.0, 0.0)),)


@hookimpl
def dap3d_forces():
    return [Breaking]
'''


@pytest.fixture
def breaking(scene_file):
    """A model folder with a type of its own that returns NaN after t = 0.05 s."""
    fields = 'type = "breaking"\nbody_i = "stone"'
    scene = scene_file(('type = "weight"', fields), name="breaking/scene.toml")
    (scene.parent / "plugin.py").write_text(f"# {scene}\n{PLUGIN}")
    return scene.parent


@pytest.mark.slow
def test_a_number_that_is_none_stops_the_run_and_keeps_what_was_before(dap3d, breaking):
    stopped = dap3d("run", "breaking", "--allow-code", "--json")
    assert stopped.returncode == 3
    found = json.loads(stopped.stdout)
    assert (found["status"], found["exit_code"]) == ("stopped", 3)
    assert "gravity" in found["reason"]  # the force is named
    assert "gravity" in stopped.stderr
    result = dap.open(dap3d.folder / "breaking.nc")
    assert result.status == "stopped"
    assert 0.0 < result.t[-1] <= 0.05 + 1e-12
    assert dap3d("info", "breaking.nc").returncode == 0


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
