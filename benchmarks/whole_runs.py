"""Runs from start to end: accuracy against time, start-up of the program, size."""

import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import scenes

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

#: Measured in a fresh process: seconds to build the scene, to compile it, for one right-hand side;
#: peak memory.
LARGE = """
import sys, time, resource; sys.path.insert(0, {folder!r})
import scenes
from dap3d_core.simulation import CompiledModel
start = time.perf_counter(); scene = scenes.chain({n}); built = time.perf_counter()
compiled = CompiledModel(scene); done = time.perf_counter()
compiled.rhs(0.0, compiled.model.u0)
print(built - start, done - built, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)
"""


def dop853_on_a_chain():
    """Chain of 8 spherical joints for 1 s: error of the end and time, by tolerance."""
    compiled = CompiledModel(scenes.chain(8))

    def run(rtol):
        return dap.simulate(compiled, t_end=1.0, dt=1.0, rtol=rtol, atol=rtol, project=False)

    reference = run(1e-14).r[-1]
    rows = []
    for rtol in (1e-5, 1e-7, 5e-8, 1e-9, 1e-11):
        times = []
        for _ in range(7):
            start = time.perf_counter()
            result = run(rtol)
            times.append(time.perf_counter() - start)
        error = float(np.max(np.linalg.norm(result.r[-1] - reference, axis=1)))
        rows.append(
            {
                "rtol": rtol,
                "error_m": error,
                "ms": 1e3 * statistics.median(times),
                "steps": result.stats.steps,
                "rhs": result.stats.rhs,
            }
        )
    return rows


def large(n=100_000):
    """Building and compiling a chain of n bodies in a fresh process."""
    script = LARGE.format(folder=os.path.dirname(__file__), n=n)
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    scene_s, compile_s, memory = map(float, done.stdout.split())
    return [{"bodies": n, "scene_s": scene_s, "compile_s": compile_s, "peak_memory_gib": memory}]


def start_up():
    """Whole processes: help, a first run with an empty cache, a run with a warm one."""
    program = [sys.executable, "-m", "dap3d_core.cli"]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        run = [*program, "run", "pen1", "-o", os.path.join(folder, "pen1.nc"), "--force"]
        env = os.environ | {"DAP3D_CACHE_DIR": os.path.join(folder, "cache")}
        for title, command, repeats in (
            ("dap3d --help", [*program, "--help"], 7),
            ("dap3d run pen1, empty cache", run, 1),
            ("dap3d run pen1", run, 7),
        ):
            times = []
            for _ in range(repeats):
                start = time.perf_counter()
                subprocess.run(command, check=True, capture_output=True, env=env, cwd=folder)
                times.append(time.perf_counter() - start)
            rows.append({"command": title, "seconds": statistics.median(times), "runs": repeats})
    return rows
