"""Fixed cost of one compiled integration: what a run costs that has nothing to integrate.

And of one step of rk4: by a new integration, and by a prepared one, started again.
"""

import statistics
import time

import scenes
from peers.prepared_run import PreparedRun

from dap3d_core.integrators import TABLEAUS, RungeKutta, Status
from dap3d_core.simulation import CompiledModel

CALLS, REPEATS = 1000, 15


def call():
    """Microseconds to set up an integration, and to enter and leave its compiled loop."""
    evaluator = CompiledModel(scenes.chain(1)).evaluator
    y0 = evaluator.integrated(evaluator.model.u0)

    def make():
        return RungeKutta(
            TABLEAUS["dop853"], evaluator.functions, evaluator.system, evaluator.loops, y0,
            [0.0, 1e-3],
            report_size=evaluator.report_size, length_count=evaluator.length_count, buffer_rows=2,
        )  # fmt: skip

    done = make()
    assert done.advance(1000) is Status.FINISHED

    def microseconds(function):
        """Of a call, in CPU time of the thread: other programs weigh less on it."""
        start = time.thread_time()
        for _ in range(CALLS):
            function()
        return 1e6 * (time.thread_time() - start) / CALLS

    def one_step():
        return RungeKutta(
            TABLEAUS["rk4"], evaluator.functions, evaluator.system, evaluator.loops, y0,
            [0.0, 1e-3], step=1e-3, report_size=evaluator.report_size, buffer_rows=2,
        )  # fmt: skip

    parts = {"set up": make, "compiled call": lambda: done.advance(0),
             "one step, new": lambda: one_step().advance(1000),
             "one step, prepared": PreparedRun(one_step()).run}  # fmt: skip
    times = [[microseconds(function) for function in parts.values()] for _ in range(REPEATS)]
    found = [{"part": part, "us": statistics.median(column)}
             for part, column in zip(parts, zip(*times, strict=True), strict=True)]  # fmt: skip
    both = sum(row["us"] for row in found[:2])
    return [*found[:2], {"part": "both", "us": both}, *found[2:]]
