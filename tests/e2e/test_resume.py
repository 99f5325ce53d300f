"""Runs that were killed or ended, and what goes on from them."""

import json
import signal
import subprocess
import sys

import attrs
import pytest
from tests.e2e.conftest import environment

import dap3d_core as dap

KILLED = '''
"""Kill runs at random moments; after each, what is on the disk must be whole."""

import os
import random
import signal
import sys
import time
from importlib import import_module
from pathlib import Path

import dap3d_core as dap
from dap3d_core.simulation.checkpoint.save import read_checkpoint

runs = import_module("dap3d_core.simulation.run")
runs.CHUNK_SECONDS, runs.FIRST_CHUNK = 1e-3, 100
import_module("dap3d_core.simulation.run_state").SHORT_SECONDS = 0.05
SETTINGS = {"t_end": 6.0, "dt": 0.02}
compiled = dap.compile("pen1")
whole = dap.simulate(compiled, **SETTINGS)
random.seed(20)


def begin(work):
    """A process that does the work; its number."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    return child


def run():
    dap.simulate(compiled, output="run.nc", checkpoint=1e-9, force=True, **SETTINGS)


def prefix(result):
    count = len(result.t)
    assert result.u.tobytes() == whole.u[:count].tobytes(), count
    assert result.t.tobytes() == whole.t[:count].tobytes()
    return count


begun = time.perf_counter()
_, status = os.waitpid(begin(run), 0)
assert status == 0
duration = time.perf_counter() - begun
found = {"killed": 0, "with a checkpoint": 0, "resumed": 0, "resumed and killed": 0}
while found["killed"] < int(sys.argv[1]):
    for file in Path().iterdir():
        file.unlink()
    child = begin(run)
    time.sleep(random.uniform(0.0, duration))
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if status == 0:  # too late: runs take less time than the first one did
        duration *= 0.9
        continue
    found["killed"] += 1
    files = [*Path().glob("run.nc.part*"), *Path().glob("run.nc")]  # it has its name at the end
    rows = [prefix(dap.open(file)) for file in files]
    checkpoint = Path("run.nc.checkpoint")
    if not checkpoint.exists():
        continue
    found["with a checkpoint"] += 1
    assert read_checkpoint(checkpoint).header["rows"] <= max(rows)
    if found["killed"] % 3 == 0:
        child = begin(lambda: dap.resume(checkpoint, checkpoint=1e-9))
        time.sleep(random.uniform(0.0, 0.5 * duration))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        found["resumed and killed"] += status != 0
    if checkpoint.exists():
        result = dap.resume(checkpoint)
        assert result.u.tobytes() == whole.u.tobytes()
        found["resumed"] += 1
    assert prefix(dap.open("run.nc")) == len(whole.t)
    assert not list(Path().glob("run.nc.part*")), list(Path().iterdir())
print(found)
'''


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_killed_at_any_moment_a_run_leaves_what_it_had(tmp_path):
    """Rows and checkpoint are whole each time, and the run goes on to the same bits."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", KILLED, "4"],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.replace("'", '"'))
    assert found["killed"] == 4
    assert found["resumed"] >= 1


@pytest.mark.slow
def test_a_run_is_terminated_resumed_and_made_again(dap3d):
    """By the command line: the file is that of a run that was not ended, but for its notes."""
    settings = ("pen1", "--t-end", "800", "--dt", "0.5")
    # As plain Python it takes minutes, whatever compiled code makes of it.
    process = dap3d.start("run", *settings, "--checkpoint", "1s", DAP3D_PLAIN="1")
    for line in process.stderr:
        if "left" in line:
            break
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3, err
    assert "dap3d resume pen1.nc.checkpoint" in err
    found = dap3d.succeed("resume", "pen1.nc.checkpoint", "--json")
    facts = json.loads(found.stdout)
    assert facts["status"] == "done"
    assert facts["checkpoint"] is None
    assert [f.name for f in dap3d.folder.iterdir()] == ["pen1.nc"]
    dap3d.succeed("run", *settings, "-o", "whole.nc")
    one, other = (dap.open(dap3d.folder / name) for name in ("pen1.nc", "whole.nc"))
    assert one.u.tobytes() == other.u.tobytes()
    again = dap3d.succeed("rerun", "pen1.nc")
    assert "equal bit for bit; 1,601 instants compared" in again.stdout


def test_rerun_says_what_differs(dap3d, pen1, monkeypatch, capfd):
    """A result that was made with other digits: exit code 1, the arrays and by how much."""
    from dap3d_core.cli import main

    u = pen1.u.copy()
    u[3, 0] += 1e-9
    pen1.arrays = attrs.evolve(pen1.arrays, u=u)
    pen1.save(dap3d.folder / "other.nc")
    monkeypatch.chdir(dap3d.folder)
    monkeypatch.setenv("COLUMNS", "60")
    assert main(["rerun", "other.nc"]) == 1
    err = capfd.readouterr().err
    assert "not equal" in err
    assert "u: differs by up to 1e-09" in err
    assert main(["rerun", "other.nc", "--json"]) == 1
    found = json.loads(capfd.readouterr().out)
    assert found["equal"] is False
    assert found["differences"]["u"] == pytest.approx(1e-9, rel=1e-6)
