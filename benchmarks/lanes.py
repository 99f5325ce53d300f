"""Points of a study in lanes of a vector, one by one by programs, and by general code; by mass.

CPU time of this thread, the least of several rounds in turn. Outputs of all are compared bit for
bit. Runs of which the end alone is reported, by default tolerances; rk4 by steps of 2 ms.
"""

import time

import numpy as np
import scenes
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.formulations.programs import change_over
from dap3d_core.study import Ensemble, Study, outputs_of

ROUNDS = 7
#: Joint, bodies, points, end of a run, integrator.
CASES = (
    ("pen1", 1, 2048, 2.0, "dop853"),
    ("fourbar3", 3, 512, 2.0, "dop853"),
    ("tri", 5, 512, 2.0, "dop853"),
    ("rev", 1, 2048, 1.0, "dop853"),
    ("rev", 8, 256, 1.0, "dop853"),
    ("rev", 8, 256, 1.0, "dopri5"),
    ("rev", 8, 128, 1.0, "rk4"),
    ("sph", 8, 256, 1.0, "dop853"),
    ("rev", 64, 64, 0.5, "dop853"),
    ("rev", 24, 128, 0.5, "dop853"),
    ("rev", 512, 32, 0.05, "dop853"),
)


def measure():
    """Rows of the table."""
    change_over.MAKE_AFTER, change_over.BESIDE = 0.0, False
    return [_row(*case) for case in CASES]


def _row(joint, n, count, t_end, integrator):
    is_model = joint in dap.shipped_models()
    scene = dap.load(joint) if is_model else scenes.chain(n, joint)
    last = list(scene.bodies)[-1]
    settings = scene.simulation
    settings.method, settings.integrator = "auto" if is_model else "joint", integrator
    settings.t_end = settings.dt = t_end
    if integrator == "rk4":
        settings.step = 0.002
    study = Study(scene, (f"bodies.{last}.mass",), outputs_of([f"{last}.r:series"]))
    points = np.linspace(1.0, 1.5, count)[:, None] * float(scene.bodies[last].mass)
    ways = {way: Ensemble(study) for way in ("lanes", "one by one", "general")}
    for way in ("one by one", "general"):
        ways[way]._runner().compiled_batch.takes_lanes = False
    seconds, values = dict.fromkeys(ways, np.inf), {}
    for k in range(3 + ROUNDS):
        for way, of in ways.items():
            change_over.LOAD_AFTER = np.inf if way == "general" else 0.0
            begun = time.thread_time()
            values[way] = of.run(points).values
            if k >= 3:
                seconds[way] = min(seconds[way], time.thread_time() - begun)
        wait_for_good_code()
    lanes = ways["lanes"]._runner().compiled_batch.lanes
    one, *others = values.values()
    return {
        "scene": joint,
        "bodies": n,
        "integrator": integrator,
        "lanes": lanes if isinstance(lanes, str) or lanes is None else lanes.count,
        "point_us": 1e6 * seconds["lanes"] / count,
        "one_by_one_us": 1e6 * seconds["one by one"] / count,
        "general_us": 1e6 * seconds["general"] / count,
        "part_of_general": seconds["lanes"] / seconds["general"],
        "equal_bits": all(
            np.array_equal(one[name], other[name]) for other in others for name in one
        ),
    }
