"""Long runs: memory where rows go to disk as they come, and what a checkpoint costs."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import scenes

import dap3d_core as dap

#: A run of its own process, for its peak memory.
RUN = """
import json, os, resource, sys, time; sys.path.insert(0, {folder!r})
import scenes
import dap3d_core as dap
count = {count}
begun = time.process_time()
result = dap.simulate(scenes.chain(10), t_end=count * 1e-4, dt=1e-4, rtol=1e-6, output="run.nc")
spent = time.process_time() - begun
entries = result.ledger
print(json.dumps({{
    "instants": len(result.t),
    "file_MB": os.path.getsize("run.nc") / 1e6,
    "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
    "us_an_instant": 1e6 * spent / count,
    "ledger_ok": all(entry.ok is not False for entry in entries.values()),
}}))
"""
COUNTS = (1_000, 100_000, 1_000_000)


def measure():
    """Rows of the table: runs of ten bodies with more and more instants; checkpoints."""
    folder = str(Path(__file__).parent)
    rows = []
    for count in COUNTS:
        with tempfile.TemporaryDirectory() as place:
            done = subprocess.run(
                [sys.executable, "-c", RUN.format(folder=folder, count=count)],
                cwd=place, env=os.environ, capture_output=True, text=True, check=True,
            )  # fmt: skip
        rows.append({"case": "ten bodies", **json.loads(done.stdout)})
    return rows + [checkpoints(n) for n in (1, 10, 1000)]


def checkpoints(count):
    """Size of a checkpoint, and the time one takes beside the run."""
    sizes, begun = [], time.perf_counter()

    def watch(_):
        path = Path(place) / "run.nc.checkpoint"
        sizes.append(path.stat().st_size if path.exists() else 0)

    with tempfile.TemporaryDirectory() as place:
        output = Path(place) / "run.nc"
        compiled = dap.compile(scenes.chain(count))
        settings = {"t_end": 200.0 / count, "dt": 1.0 / count, "output": output, "force": True}
        times = []
        for every in (None, 1e-9):
            begun = time.perf_counter()
            dap.simulate(compiled, checkpoint=every, watch=watch, **settings)
            times.append(time.perf_counter() - begun)
    taken = sum(size > 0 for size in sizes)
    return {
        "case": f"chain of {count}",
        "checkpoints": taken,
        "checkpoint_kB": max(sizes) / 1e3,
        "ms_a_checkpoint": 1e3 * (times[1] - times[0]) / max(taken, 1),
    }
