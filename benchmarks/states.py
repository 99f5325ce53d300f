"""A state added to an element: a right-hand side against one without it, by CPU time.

python benchmarks/states.py
"""

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from right_hand_side import repeat
from support.own_types import registry_of
from timing import wait_for_good_code

from dap3d_core import Scene
from dap3d_core.interface import Force, Vector2, number, vector2
from dap3d_core.kernels import cross, dot, neg, scale, sqrt
from dap3d_core.simulation import CompiledModel

#: Bodies of a chain of springs; right-hand sides of one timing; pairs of timings.
SIZES, WORK, PAIRS = (1, 8, 64), 200_000, 25


class Spring(Force):
    """Spring and damper between two points."""

    keyword = "benchmark-spring"
    d: Vector2 = vector2()
    k: float = number(100.0)
    c: float = number(1.0)
    l0: float = number(1.0)

    def wrench(d, d_dot, s_P_i, s_P_j, k, c, l0):
        length = sqrt(dot(d, d))
        return pull(k * (length - l0) + c * dot(d, d_dot) / length, length, d, s_P_i, s_P_j)


class Remembering(Force):
    """The same, and a spring in series with the damper, whose elongation is a state."""

    keyword, states = "benchmark-states", ("z",)
    d: Vector2 = vector2()
    k: float = number(100.0)
    c: float = number(1.0)
    l0: float = number(1.0)

    def rate(d, z, k, c, l0):
        return k / c * (sqrt(dot(d, d)) - l0 - z)

    def wrench(d, d_dot, z, s_P_i, s_P_j, k, c, l0):
        length = sqrt(dot(d, d))
        tension = k * (length - l0 - z) + c * dot(d, d_dot) / length
        return pull(tension, length, d, s_P_i, s_P_j)


def pull(tension, length, d, s_i, s_j):
    """The tension along d at the ends of the arms."""
    F = scale(tension / length, d)
    return (F, cross(s_i, F)), (neg(F), neg(cross(s_j, F)))


def chain(keyword, n, joints):
    """n bodies in a row, each tied to the one before; with joints, also by ball joints."""
    scene = Scene(name="chain of springs")
    for k in range(n):
        scene.add_body(f"b{k}", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.5 * (k + 1), 0.1 * k, 0.0))
        before = f"b{k - 1}" if k else "ground"
        scene.add_point(f"end{k}", f"b{k}", (-0.2, 0.1, 0.0))
        scene.add_force(keyword, f"f{k}", P_i=f"end{k}", P_j=f"{before}.O")
        if joints:
            place = (1.5, 0.1, 0.0) if k else (1.5, 0.0, 0.0)
            scene.add_point(f"pin{k}", before, place)
            scene.add_joint("sph", f"j{k}", P_i=f"b{k}.O", P_j=f"pin{k}")
    return scene


def measure():
    """Rows of the table: microseconds of both, and the ratio (median, least) of pairs."""
    registry, rows = registry_of(Spring, Remembering), []
    for joints in (False, True):
        for n in SIZES:
            runs = [ours(chain(t.keyword, n, joints), registry) for t in (Spring, Remembering)]
            for run in runs:
                run()
            wait_for_good_code()
            pairs = np.array([[seconds(run) for run in runs] for _ in range(PAIRS)])
            ratio = pairs[:, 1] / pairs[:, 0]
            without, with_ = pairs.min(axis=0) / (WORK // n) * 1e6
            rows.append({"scene": f"{n} {'joined' if joints else 'free'}", "us_without": without,
                         "us_with": with_, "ratio_median": statistics.median(ratio),
                         "ratio_of_least": with_ / without})  # fmt: skip
    return rows


def ours(scene, registry):
    """A function that evaluates right-hand sides of a scene."""
    evaluator = CompiledModel(scene, registry=registry).evaluator
    y = evaluator.integrated(evaluator.model.u0)
    out, count = np.zeros_like(y), WORK // evaluator.model.body_count
    functions, system, loops = evaluator.functions, evaluator.system, evaluator.loops
    return lambda: repeat(functions, count, y, out, system, loops)


def seconds(function):
    """CPU seconds of the thread."""
    start = time.thread_time()
    function()
    return time.thread_time() - start
