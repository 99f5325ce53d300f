"""What a user waits for: the first run on a machine, the next ones, and one after an edit.

Whole processes, in wall and in CPU seconds, their children included: what is compiled beside goes
on after a first run has ended.
"""

import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

#: The model, the first scene with radau, and how often a command is repeated.
MODEL, REPEATS = "fourbar3", 5
PLUGIN = """
from dap3d_core.interface import Body, Force, body, hookimpl
interface_version = 1
class Push(Force):
    keyword = "push"
    body_i: Body = body()
    def wrench(mass_i, r_i):
        return ((mass_i * {strength} * r_i[0], 0.0, 0.0), (0.0, 0.0, 0.0)),
@hookimpl
def dap3d_forces():
    return [Push]
"""
SCENE = """
[scene]
name = "pushed"
schema = 1
[bodies.a]
mass = 1.0
Jp = [1.0, 1.0, 1.0]
r = [1.0, 0.0, 0.0]
[forces.p]
type = "push"
body_i = "a"
[simulation]
t_end = 0.1
dt = 0.05
"""


def seconds(command, env, folder):
    """Wall and CPU seconds of a process."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=env, cwd=folder)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def row(case, times):
    """A row of the table from (wall, CPU) of some runs."""
    wall, cpu = (statistics.median(column) for column in zip(*times, strict=True))
    return {"case": case, "wall_s": wall, "cpu_s": cpu, "runs": len(times)}


def measure():
    """Rows of the table: first runs, runs that find all in the cache, a run after an edit."""
    dap3d = [sys.executable, "-m", "dap3d_core.cli"]
    with tempfile.TemporaryDirectory() as name:
        folder, cache = Path(name), Path(name) / "cache"
        env = os.environ | {"DAP3D_CACHE_DIR": str(cache)}

        def runs(case, *arguments, empty=False, count=REPEATS):
            times = []
            for _ in range(count):
                if empty:
                    _settled(cache)
                    shutil.rmtree(cache, ignore_errors=True)
                command = [*dap3d, "run", *arguments, "-o", "run.nc", "--force"]
                times.append(seconds(command, env, folder))
            _settled(cache)
            return row(case, times)

        rows = [
            runs("first run", MODEL, empty=True),
            runs("warm run", MODEL),
            runs("first run, radau", MODEL, "--integrator", "radau", empty=True),
        ]
        own, times = folder / "pushed", []
        own.mkdir()
        (own / "scene.toml").write_text(SCENE)
        for strength in range(REPEATS + 1):
            (own / "plugin.py").write_text(PLUGIN.format(strength=float(-strength)))
            command = [*dap3d, "run", str(own), "--allow-code", "-o", "run.nc", "--force"]
            times.append(seconds(command, env, folder))
            _settled(cache)
        return [*rows, row("edit to result", times[1:])]


def _settled(cache):
    """Wait until the process beside is done."""
    while list(cache.glob("*.ll")):
        time.sleep(0.05)
