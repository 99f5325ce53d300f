"""What a second thread gains on large scenes: one right-hand side, and a run of dop853.

Wall time, the least of many short ones, in turn: what others do on the machine only adds. A row
says how long one thread takes on the program in halves, how much longer that is than the program
that is not cut, and the gain by the second thread over either.
"""

import sys
import time

import loops
import numpy as np
import scenes

import dap3d_core as dap
from dap3d_core import formulations
from dap3d_core.formulations.evaluator import Machine
from dap3d_core.formulations.two_threads.worker_thread import SecondThread
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.simulation import CompiledModel

#: Scenes, and the length of a run in s.
SCENES = (
    ("chain, 300 rods", lambda: scenes.chain(300), 0.05),
    ("chain, 1000 rods", lambda: scenes.chain(1000), 0.02),
    ("chain, 10 000 rods", lambda: scenes.chain(10_000), 0.005),
    ("chain, 100 000 rods", lambda: scenes.chain(100_000), 0.001),
    ("star, 1000 arms", lambda: scenes.star(1000), 0.05),
    ("net, 50 x 50 knots", lambda: loops.net(50), 0.02),
)
#: Bodies that one timing evaluates; rounds; seconds of each way in a round, and of all runs.
WORK, ROUNDS, SECONDS, RUN_SECONDS = 3000, 10, 0.2, 20.0


class Always(SecondThread):
    """Helps in each call."""

    def _faster(self):
        return True


@compiled
def repeat(functions, count, y, out, system, loops):
    """Call the right-hand side of a formulation count times."""
    rhs = functions[0]
    for _ in range(count):
        rhs(0.0, y, out, system, loops)


def whole(model):
    """The machine of a model whose program is not cut."""
    module, least = formulations.IN_HALVES["standard"]
    formulations.IN_HALVES["standard"] = module, sys.maxsize
    machine = Machine(model, "standard")
    formulations.IN_HALVES["standard"] = module, least
    return machine


def shortest(machine):
    """Least seconds of a right-hand side, of bursts that follow one another for a while."""
    y = machine.integrated(machine.model.u0)
    out, count = np.zeros_like(y), max(1, WORK // machine.model.body_count)
    arguments = machine.functions, count, y, out, machine.system, machine.loops
    found, end = np.inf, time.perf_counter() + SECONDS
    while time.perf_counter() < end:
        start = time.perf_counter()
        repeat(*arguments)
        found = min(found, (time.perf_counter() - start) / count)
    return found


def right_hand_sides(compiled, helper):
    """Least seconds of a right-hand side: not cut, in halves, in halves with a second thread."""
    uncut, machine = whole(compiled.model), compiled.machine
    shortest(uncut), shortest(machine)
    best = np.full(3, np.inf)
    for _ in range(ROUNDS):
        times = [shortest(uncut), shortest(machine)]
        with helper:
            times.append(shortest(machine))
        best = np.minimum(best, times)
    return best.tolist()


def runs(compiled, helper, t_end):
    """Least seconds of a run of one thread and of two."""
    best = [np.inf, np.inf]
    end = time.perf_counter() + RUN_SECONDS
    while time.perf_counter() < end:
        for k, second in enumerate((None, helper)):
            compiled.machine.__dict__["second_thread"] = second
            result = dap.simulate(compiled, t_end=t_end, dt=t_end)
            best[k] = min(best[k], result.stats.wall_time_s)
    return best


def measure():
    """Rows of the table."""
    rows = []
    module, _ = formulations.IN_HALVES["standard"]
    formulations.IN_HALVES["standard"] = module, 300
    for title, make, t_end in SCENES:
        compiled = CompiledModel(make())
        helper = Always(compiled.machine.system, compiled.machine.loops)
        uncut, one, two = right_hand_sides(compiled, helper)
        run_one, run_two = runs(compiled, helper, t_end)
        rows.append(
            {
                "scene": title,
                "rhs_ms": 1e3 * one,
                "rhs_to_uncut": one / uncut,
                "rhs_gain": one / two,
                "rhs_gain_over_uncut": uncut / two,
                "run_s": run_one,
                "run_gain": run_one / run_two,
            }
        )
    return rows
