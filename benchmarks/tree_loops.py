"""Time to an error of four-bars in joint coordinates, over that of method standard or lsq.

Rows of 1, 10 and 40 parallelograms (A02) for 10 s, with projection, through some eight poses at
which all links are in line; couplers on spherical joints, which standard takes, and all revolutes,
3 rows a loop redundant, for lsq. The reference is the one closed equation of the cranks.
"""

import time

import loops
import numpy as np
from support import redundant
from timing import wait_for_good_code

from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.integrators import TABLEAUS, RungeKutta, Status
from dap3d_core.model.state_layout import split
from dap3d_core.simulation import CompiledModel

COUNTS = 1, 10, 40
COUPLERS = {"sph": "standard", "rev": "lsq"}
TOLERANCES = 10.0 ** np.arange(-4.0, -12.5, -1.0)
ERRORS = 1e-3, 1e-5, 1e-7
#: Runs of each, in turn; the least CPU time counts.
REPEATS = 5
TIMES = np.linspace(0.0, 10.0, 21)


def run(evaluator, u, rtol):
    """CPU seconds of the integration from a state u, and x, y, v_x, v_y of the crank's tip."""
    store_reference_pivots(evaluator, 0.0, u)
    evaluator.start(0.0, u)
    y0 = evaluator.coordinates.start(u)
    integration = RungeKutta(
        TABLEAUS["dop853"], evaluator.functions, evaluator.system, evaluator.loops, y0, TIMES,
        rtol=rtol, atol=rtol, project_on=True, error_size=len(y0) - 1,
        report_size=evaluator.report_size, length_count=evaluator.length_count,
        buffer_rows=len(TIMES),
    )  # fmt: skip
    start = time.thread_time()
    assert integration.advance(10**9) is Status.FINISHED
    seconds = time.thread_time() - start
    rows = evaluator.body_rows(integration.rows())
    r, _, v, _ = split(rows[:, 1 : len(u) + 1])
    return seconds, 2.0 * np.hstack([r[:, 0, :2], v[:, 0, :2]])


def curves(scene, methods, reference):
    """Error and least CPU seconds of a run at each tolerance, by method."""
    compiled = {method: CompiledModel(scene, method=method) for method in methods}
    found = {method: np.full((len(TOLERANCES), 2), np.inf) for method in methods}
    for model in compiled.values():
        run(model.evaluator, model.model.u0, 1e-3)
    wait_for_good_code()
    for k, rtol in enumerate(TOLERANCES):
        for _ in range(REPEATS):
            for method, model in compiled.items():
                seconds, tip = run(model.evaluator, model.model.u0, rtol)
                error = redundant.error_of(tip[1:], reference[1:])
                found[method][k] = error, min(seconds, found[method][k, 1])
    return found


def time_to(error, curve):
    """CPU seconds to an error, between those of the tolerances around it; NaN beyond them.

    A looser tolerance that is as exact as a tighter one stands for that as well.
    """
    errors, seconds = np.minimum.accumulate(curve[:, 0]), curve[:, 1]
    at = np.interp(-np.log(error), -np.log(errors), np.log(seconds), np.nan, np.nan)
    return float(np.exp(at))


def measure():
    """Rows of the table: loops, couplers, and for each error the ratio of times."""
    rows = []
    for couplers, usual in COUPLERS.items():
        for count in COUNTS:
            reference = redundant.four_bars_tip(count, TIMES)
            scene = loops.fourbars(count, couplers)
            found = curves(scene, (usual, "joint"), reference)
            row = {"loops": count, "couplers": couplers, "against": usual}
            for error in ERRORS:
                times = {method: time_to(error, curve) for method, curve in found.items()}
                row[f"ms_to_{error:.0e}"] = 1e3 * times["joint"]
                row[f"ratio_at_{error:.0e}"] = times["joint"] / times[usual]
            rows.append(row)
    return rows
