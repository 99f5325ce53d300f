"""Large scenes and scenes with many loops: what the elimination costs, and how it grows.

Seconds are of the processor, the least of several: other programs only add.
"""

import json
import os
import subprocess
import sys
import time

import loops
import numpy as np
import scenes

import dap3d_core as dap
from dap3d_core.linear.ldlt.factor import assemble, factor
from dap3d_core.linear.ldlt.plan import make_plan
from dap3d_core.linear.ordering import elimination_order
from dap3d_core.simulation import CompiledModel

SCENES = (
    ("A02, 40 four-bars", lambda: loops.fourbars(40)),
    ("A02, 200 four-bars", lambda: loops.fourbars(200)),
    ("net, 12 x 12 knots", lambda: loops.net(12)),
    ("net, 25 x 25 knots", lambda: loops.net(25)),
    ("net, 50 x 50 knots", lambda: loops.net(50)),
    ("star, 1000 arms", lambda: scenes.star(1000)),
    ("ladder, 100 rungs", lambda: loops.ladder(100)),
    ("ladder, 1000 rungs", lambda: loops.ladder(1000)),
    ("chain, 1000 rods", lambda: scenes.chain(1000)),
)
REPEATS = 7
#: Motion that is timed, s.
MOTION = 0.1

#: A run of its own process, for its peak memory.
LONG = """
import json, resource, sys, time; sys.path.insert(0, {folder!r})
import scenes
import dap3d_core as dap
from dap3d_core.simulation import CompiledModel
clock = [time.process_time()]
def lap():
    clock.append(time.process_time())
    return clock[-1] - clock[-2]
scene = scenes.planar_chain({n}); built = lap()
compiled = CompiledModel(scene, joint=False); done = lap()
result = dap.simulate(compiled, t_end=1.0, dt=0.5); run = lap()
fall = [0.5 * 9.81 * t**2 for t in result.t]
print(json.dumps(dict(bodies={n}, scene_s=built, compile_s=done, run_s=run,
    steps=result.stats.steps, rhs=result.stats.rhs,
    tip_error_m=float(max(abs(result.r[:, -1, 1] + fall))),
    peak_memory_gib=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)))
"""


def least_seconds(function, prepare=lambda: None):
    """Least processor time of a function; ``prepare`` is called before each call, off the clock."""
    found = []
    for _ in range(REPEATS):
        prepare()
        start = time.thread_time()
        function()
        found.append(time.thread_time() - start)
    return min(found)


def planned(model):
    """The plan of a model, and the work of minimum degree alone."""
    arguments = model.body_count, model.joint_slots, model.joint_rows.tolist()
    wide, elimination_order.WIDE = elimination_order.WIDE, sys.maxsize
    alone = elimination_order.order_nodes(*arguments)
    elimination_order.WIDE = wide
    start = time.process_time()
    plan = make_plan(*arguments)
    return plan, time.process_time() - start, alone


def row(title, scene):
    """One row of the table."""
    compiled = CompiledModel(scene, joint=False)
    evaluator, model = compiled.evaluator, compiled.model
    plan, plan_s, alone = planned(model)
    s, y = evaluator.system, evaluator.integrated(model.u0)
    out = np.zeros_like(y)

    def rhs():
        evaluator.functions[0](0.0, y, out, s, evaluator.loops)

    def filled():
        assemble(s.targets, s.contributions, s.D, s.K)
        diagonal = np.concatenate([d + np.arange(m) * (m + 1) for m, _, d, *_ in s.nodes[:-1]])
        s.K[diagonal] -= 1e-9  # redundant rows have factors, too

    rhs()
    rhs_s = least_seconds(rhs)
    factor_s = least_seconds(
        lambda: factor(s.nodes, s.columns, s.updates, s.K, s.smallest, False), filled
    )
    dap.simulate(compiled, t_end=0.01, dt=0.01)
    start = time.process_time()
    stats = dap.simulate(compiled, t_end=MOTION, dt=MOTION).stats
    motion_s = time.process_time() - start
    work = plan.ordering.work
    return {
        "scene": title,
        "method": compiled.method,
        "bodies": model.body_count,
        "rows": model.row_count,
        "plan_s": plan_s,
        "fill_blocks": plan.fill,
        "numbers": plan.matrix_size,
        "to_unfilled": plan.matrix_size / plan.unfilled_size,
        "mflop": 2e-6 * work,
        "to_min_degree": work / alone.work,
        "factor_ms": 1e3 * factor_s,
        "gflop_per_s": 2e-9 * work / factor_s,
        "rhs_ms": 1e3 * rhs_s,
        "motion_s": motion_s,
        "steps": stats.steps,
    }


def measure():
    """Rows of the table."""
    return [row(title, make()) for title, make in SCENES]


def long_chain(n=100_000):
    """A chain of n bodies for 1 s; its tip falls freely (g t^2 / 2). Takes some ten minutes."""
    script = LONG.format(folder=os.path.dirname(os.path.abspath(__file__)), n=n)
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [json.loads(done.stdout)]
