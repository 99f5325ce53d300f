"""What one right-hand side of a tree costs in joint coordinates, over that of method standard.

Chains of revolute and spherical joints, both in turn; random trees of revolute, spherical and
translational joints, and with cylindrical and universal ones, which take two nodes; n bodies each.
"""

import time

import numpy as np
import scenes
from right_hand_side import repeat
from support import trees
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

SIZES = (1, 8, 64, 1000, 10_000)
#: Bodies whose right-hand sides one timing evaluates: some 10 ms.
WORK = 40_000
#: Timings of each, in turn.
REPEATS = 15
MECHANISMS = {
    "revolute": lambda n: scenes.chain(n, "rev"),
    "spherical": scenes.chain,
    "mixed": trees.mixed_chain,
    "random": lambda n: trees.random_tree(n, joints=("rev", "sph", "tran", "rev")),
    "random, of all joints": trees.random_tree,
}
METHODS = ("standard", "joint")
#: Bodies of a tree from which on auto chooses joint, and durations of its runs, s.
CHOICE_SIZES, DURATIONS = (16, 32, 64, 128, 256), (1.0, 3.0, 10.0)


def seconds_of(scene):
    """Least CPU seconds of a right-hand side by each method, timed in turn."""
    found, runs = {method: [] for method in METHODS}, {}
    for method in METHODS:
        evaluator = CompiledModel(scene, method=method).evaluator
        y = evaluator.coordinates.start(evaluator.model.u0)
        count = max(2, WORK // evaluator.model.body_count)
        arguments = y, np.zeros_like(y), evaluator.system, evaluator.loops
        runs[method] = count, evaluator.functions, arguments
        repeat(evaluator.functions, 2, *arguments)
    wait_for_good_code()
    for _ in range(REPEATS):
        for method, (count, functions, arguments) in runs.items():
            start = time.thread_time()
            repeat(functions, count, *arguments)
            found[method].append((time.thread_time() - start) / count)
    return {method: min(times) for method, times in found.items()}


def measure():
    """Rows of the table: mechanism, bodies, microseconds a body, and the ratio."""
    rows = []
    for name, made in MECHANISMS.items():
        for n in SIZES:
            seconds = seconds_of(made(n))
            row = {"mechanism": name, "bodies": n}
            row |= {f"{m}_us_per_body": 1e6 * s / n for m, s in seconds.items()}
            row["ratio"] = seconds["joint"] / seconds["standard"]
            rows.append(row)
    return rows


def choice():
    """Whole runs, compilation of a scene that is in the cache included: joint over standard.

    CPU seconds of the thread, the least of three, at rtol 1e-6.
    """
    rows = []
    for name in ("spherical", "mixed", "random, of all joints"):
        for n in CHOICE_SIZES:
            scene, row = MECHANISMS[name](n), {"mechanism": name, "bodies": n}
            for t in DURATIONS:
                joint, standard = (_whole(scene, t, method) for method in ("joint", "standard"))
                row |= {f"ratio_{t:g}_s": joint / standard, f"standard_ms_{t:g}_s": 1e3 * standard}
            rows.append(row)
    return rows


def _whole(scene, t_end, method):
    found = []
    for _ in range(3):
        start = time.thread_time()
        dap.simulate(scene, t_end=t_end, dt=t_end / 50, rtol=1e-6, method=method)
        found.append(time.thread_time() - start)
    return min(found)
