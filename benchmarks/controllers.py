"""Cost of controllers and of steps taken by a script, beside the integration that they ask for.

Python controllers of an arm of six hinges at 500 Hz: what a sample costs besides what is integrated
in the hold, with a controller that does no work of its own; and the same for ``run.step``. The bare
loop does the same holds by compiled calls alone. Medians of pairs, in CPU time of the thread.

    python benchmarks/controllers.py
"""

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.arm import NAMES, arm_scene

import dap3d_core as dap
from dap3d_core.integrators.stepping.hold import LIMIT, VALID, H

EVERY, HOLDS, PAIRS = 0.002, 500, 21
#: Two settings of all inputs, in turn: each sample changes them.
SETTINGS = [{name: 0.1 * (k + 1) * sign for k, name in enumerate(NAMES)} for sign in (1, -1)]


def bare(run):
    """Seconds of the holds by compiled calls: inputs and limits are set by array items."""
    hold, integration = run._hold, run._hold.integration
    work, advance = integration.work, integration.prepared()
    F, rows = run._evaluator.system.F, run._evaluator.model.input_rows
    values = [[setting[name] for name in NAMES] for setting in SETTINGS]
    real, integer = hold._real, hold._integer
    first = work.t
    begin = time.thread_time()
    for k in range(HOLDS):
        F[rows, 0] = values[k % 2]
        integer[VALID] = 0
        h = real[H]
        real[LIMIT] = first + (k + 1) * EVERY
        advance(100_000)
        real[H] = max(h, real[H])
    return time.thread_time() - begin


def stepped(run):
    """Seconds of the same holds by ``run.step``."""
    begin = time.thread_time()
    for k in range(HOLDS):
        run.step(EVERY, SETTINGS[k % 2])
    return time.thread_time() - begin


def controlled(compiled, integrator):
    """Seconds of the same holds in a run with a controller, less those of setting it up."""
    count = [0]

    def update(t, state):
        count[0] += 1
        return SETTINGS[count[0] % 2]

    def seconds(t_end):
        controllers = [dap.Controller(every=EVERY, update=update)]
        begin = time.thread_time()
        dap.simulate(compiled, t_end=t_end, dt=t_end, rtol=1e-6, integrator=integrator,
                     controllers=controllers)  # fmt: skip
        return time.thread_time() - begin

    return seconds(HOLDS * EVERY) - seconds(EVERY)


def cost(method, integrator):
    """Microseconds a hold: integration alone, and what samples and steps add to it."""
    compiled = dap.compile(arm_scene(method))
    runs = [dap.start(compiled, rtol=1e-6, integrator=integrator, record=r) for r in (True, False)]
    found = []
    for _ in range(PAIRS):
        rows = []
        for work in (lambda: bare(runs[1]), lambda: stepped(runs[0]), lambda: stepped(runs[1])):
            for run in runs:
                run.reset()
            rows.append(work())
        rows.append(controlled(compiled, integrator))
        found.append([1e6 * seconds / HOLDS for seconds in rows])
    alone, *others = zip(*found, strict=True)
    added = [statistics.median(b - a for a, b in zip(alone, one, strict=True)) for one in others]
    return statistics.median(alone), *added


def main():
    print("us a hold of 2 ms, arm of six hinges, all six inputs set each time")
    print(
        f"{'method':10}{'integrator':12}{'alone':>8}{'step':>8}{'no record':>12}{'controller':>12}"
    )
    for method in ("standard", "joint"):
        alone, recorded, step, sample = cost(method, "dopri5")
        print(f"{method:10}{'dopri5':12}{alone:8.1f}{recorded:8.1f}{step:12.1f}{sample:12.1f}")


if __name__ == "__main__":
    main()
