"""Runs with derivatives over runs alone, for 3, 7 and 8 derivatives; and compiling them.

CPU time of the compiled loop, general code optimised on both sides, least of many rounds in turn;
8 derivatives take the lanes that ``sensitivities`` gives them. Directions are of the initial state,
drawn at random; what Python does at the start is left out.
"""

import math
import time

import numpy as np
import scenes
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.kernels.runtime.lanes import Differentiation
from dap3d_core.study.sensitivities.neighbours import arrays_of, run_beside
from dap3d_core.study.sensitivities.sensitivities import directions_of

ROUNDS, DIRECTIONS = 25, (3, 7, 8)
#: Model or joint of a chain, bodies of that, end of a run, method.
CASES = (
    ("bodies2", 0, 5.0, "auto"),
    ("pen2", 0, 2.0, "auto"),
    ("fourbar3", 0, 2.0, "auto"),
    ("rev", 8, 1.0, "joint"),
    ("rev", 64, 0.5, "joint"),
)
ALL = 10**15


def measure():
    """Rows of the table."""
    return [row for case in CASES for row in _rows(*case)]


def _rows(name, n, t_end, method):
    scene = scenes.chain(n, name) if n else dap.load(name)
    compiled = dap.compile(scene, method=method)
    run = run_beside(compiled, {"t_end": t_end, "dt": t_end, "rtol": 1e-8, "atol": 1e-10})
    integration, call = run.present, run.present.call
    first = [(array, array.copy()) for _, array in arrays_of(run)]
    rng = np.random.default_rng(1)
    ways = {}
    for count in DIRECTIONS:
        _, lanes = directions_of(count)
        carried = Differentiation(1 + lanes)
        for struct in integration.loop_arguments:
            carried.wide(struct)
        ways[count] = carried

    def alone():
        integration.call = call
        return _timed(integration, first)

    def with_slopes(count):
        carried = ways[count]
        integration.call = carried.call
        state = integration.work.state
        slopes = carried.slopes(state)
        slopes[:] = 0.0
        slopes[: state.shape[1], :count] = rng.standard_normal((state.shape[1], count))
        return _timed(integration, first)

    begun = time.perf_counter()
    for count in DIRECTIONS:
        with_slopes(count)
    compiling = time.perf_counter() - begun
    wait_for_good_code()
    for count in DIRECTIONS:
        with_slopes(count)
    least = dict.fromkeys((0, *DIRECTIONS), math.inf)
    for _ in range(ROUNDS):
        least[0] = min(least[0], alone())
        for count in DIRECTIONS:
            least[count] = min(least[count], with_slopes(count))
    for count in DIRECTIONS:
        yield {
            "name": f"{name} {n}" if n else name,
            "derivatives": count,
            "run_ms": 1e3 * least[0],
            "over_run": least[count] / least[0],
            "first_s": compiling / len(DIRECTIONS),
        }


def _timed(integration, first):
    for array, before in first:
        array[...] = before
    begun = time.thread_time()
    integration.advance(ALL)
    return time.thread_time() - begun


def report(rows):
    """Print the table."""
    print(
        f"{'scene':12} {'derivatives':>11} {'run, ms':>9} {'over a run':>10} {'first run, s':>12}"
    )
    for row in rows:
        print(
            f"{row['name']:12} {row['derivatives']:11d} {row['run_ms']:9.2f} "
            f"{row['over_run']:10.2f} {row['first_s']:12.1f}"
        )


if __name__ == "__main__":
    report(measure())
