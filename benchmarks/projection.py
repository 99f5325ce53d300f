"""What projection onto the constraints costs: its share of a run, beside the run without it."""

import statistics
import time

import scenes

from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.integrators import TABLEAUS, RungeKutta, Status
from dap3d_core.simulation import CompiledModel

#: Chains of so many bodies fall for a second; each run is repeated so often.
SIZES, REPEATS = (1, 8, 64), 9


def seconds(evaluator, u, method, rtol, *, project):
    """CPU seconds of one run of a second, without reports between its ends."""
    store_reference_pivots(evaluator, 0.0, u)
    evaluator.start(0.0, u)
    y0 = evaluator.integrated(u)
    run = RungeKutta(
        TABLEAUS[method], evaluator.functions, evaluator.system, evaluator.loops, y0, [0.0, 1.0],
        rtol=rtol, atol=rtol / 100.0, project_on=project, error_size=len(y0) - 1,
        report_size=evaluator.report_size, length_count=evaluator.length_count,
    )  # fmt: skip
    start = time.thread_time()
    assert run.advance(10**9) is Status.FINISHED
    return time.thread_time() - start


def measure():
    """Rows of the table: chain, integrator, tolerance, share of the run with projection."""
    rows = []
    for joint, title in (("sph", "spherical"), ("rev", "revolute")):
        for n in SIZES:
            compiled = CompiledModel(scenes.chain(n, joint), joint=False)
            evaluator, u = compiled.evaluator, compiled.start(True, ()).u
            for method in ("dopri5", "dop853"):
                for rtol in (1e-6, 1e-9):
                    pairs = [
                        [seconds(evaluator, u, method, rtol, project=on) for on in (False, True)]
                        for _ in range(REPEATS)
                    ]
                    off, on = (statistics.median(column) for column in zip(*pairs, strict=True))
                    rows.append({"chain": title, "bodies": n, "integrator": method,
                                 "rtol": rtol, "share": 1.0 - off / on})  # fmt: skip
    return rows
