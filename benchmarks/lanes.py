"""Points of a study in the lanes of a vector, over points one by one; chains of rods, by mass.

CPU time of this thread, the least of several rounds in turn. Outputs of both are compared bit for
bit. Runs of 1 s, of which the end alone is reported, by default tolerances; rk4 by steps of 2 ms.
"""

import time

import numpy as np
import scenes
from timing import wait_for_good_code

from dap3d_core.study import Ensemble, Study, outputs_of

ROUNDS = 7
#: Joint, bodies, points, end of a run, integrator.
CASES = (
    ("rev", 1, 2048, 1.0, "dop853"),
    ("rev", 8, 256, 1.0, "dop853"),
    ("rev", 8, 256, 1.0, "dopri5"),
    ("rev", 8, 128, 1.0, "rk4"),
    ("sph", 8, 256, 1.0, "dop853"),
    ("rev", 64, 64, 0.5, "dop853"),
    ("rev", 512, 32, 0.05, "dop853"),
)


def measure():
    """Rows of the table."""
    return [_row(*case) for case in CASES]


def _row(joint, n, count, t_end, integrator):
    scene, last = scenes.chain(n, joint), f"b{n - 1}"
    settings = scene.simulation
    settings.method, settings.integrator = "joint", integrator
    settings.t_end = settings.dt = t_end
    if integrator == "rk4":
        settings.step = 0.002
    study = Study(scene, (f"bodies.{last}.mass",), outputs_of([f"{last}.r:series"]))
    points = np.linspace(1.0, 2.0, count)[:, None]
    ways = {"lanes": Ensemble(study), "one by one": Ensemble(study)}
    ways["one by one"]._runner().compiled_batch.takes_lanes = False
    lanes = ways["lanes"]._runner().compiled_batch.lanes
    wait_for_good_code()
    assert lanes.is_ready
    seconds, values = dict.fromkeys(ways, np.inf), {}
    for _ in range(ROUNDS):
        for way, of in ways.items():
            begun = time.thread_time()
            values[way] = of.run(points).values
            seconds[way] = min(seconds[way], time.thread_time() - begun)
    one, other = values.values()
    return {
        "joint": joint,
        "bodies": n,
        "integrator": integrator,
        "lanes": lanes.count,
        "point_us": 1e6 * seconds["lanes"] / count,
        "one_by_one_us": 1e6 * seconds["one by one"] / count,
        "gain": seconds["one by one"] / seconds["lanes"],
        "equal_bits": all(np.array_equal(one[name], other[name]) for name in one),
    }
