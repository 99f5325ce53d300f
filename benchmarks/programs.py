"""Whole integrations by a program of the scene's own, over those by general code.

CPU time of this thread, the least of several rounds in turn; rows are compared bit for bit. The
programs are made before.
"""

import time
from functools import partial

import loops
import numpy as np
import scenes
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.formulations.programs import change_over
from dap3d_core.integrators import EXPLICIT
from dap3d_core.scene import Simulation
from dap3d_core.simulation.settings import integration_options

ROUNDS = 15
#: Scene, method, seconds of motion.
CASES = (
    ("pen1", "standard", 20.0),
    ("bodies2", "unconstrained", 20.0),
    ("pen2", "standard", 2.0),
    ("fourbar3", "standard", 2.0),
    ("tri", "standard", 2.0),
    ("A03", "standard", 0.03),
    ("ten four-bars", "standard", 0.3),
    ("chain of 8", "joint", 1.0),
)


def measure():
    """Rows of the table, at relative tolerances 1e-6 and 1e-9."""
    return [_row(*case, rtol) for case in CASES for rtol in (1e-6, 1e-9)]


def integration_of(compiled, t_end, rtol):
    """An integration at its start, and its evaluator."""
    start, evaluator = compiled.start(True, ()), compiled.evaluator
    store_reference_pivots(evaluator, 0.0, start.u)
    evaluator.start(0.0, start.u, start.angles, start.states)
    y0, times = evaluator.coordinates.start(start.u), np.array([0.0, t_end])
    settings = Simulation(t_end=t_end, rtol=rtol, atol=rtol / 100)
    options = integration_options(evaluator, settings) | {"buffer_rows": 2}
    return evaluator, EXPLICIT.make(evaluator, y0, times, **options)


def _row(name, method, t_end, rtol):
    compiled = dap.compile(scene_of(name), method=method)
    integration_of(compiled, t_end, rtol)[1].advance(10**15)
    wait_for_good_code()
    change_over.MAKE_AFTER, change_over.BESIDE = 0.0, False
    seconds, rows = {}, {}
    for k in range(ROUNDS):
        for way, least in (("general", np.inf), ("program", 0.0)):
            change_over.LOAD_AFTER = least
            evaluator, integration = integration_of(compiled, t_end, rtol)
            programs = change_over.ChangeOver(evaluator)
            programs.during(integration, lambda: None)  # makes and names the program
            begun = time.thread_time()
            programs.during(integration, partial(integration.advance, 10**15))
            now = time.thread_time() - begun
            if k:
                seconds[way] = min(seconds.get(way, np.inf), now)
            rows[way] = integration.rows()
    return {
        "scene": name,
        "method": method,
        "rtol": rtol,
        "general_us": 1e6 * seconds["general"],
        "program_us": 1e6 * seconds["program"],
        "part": seconds["program"] / seconds["general"],
        "equal_bits": bool(np.array_equal(rows["general"], rows["program"], equal_nan=True)),
    }


def scene_of(name):
    """One made here, or a shipped model."""
    made = {"chain of 8": lambda: scenes.chain(8, "rev"), "free body": lambda: scenes.free(1),
            "ten four-bars": lambda: loops.fourbars(10, "sph")}  # fmt: skip
    return made[name]() if name in made else dap.load(name)
