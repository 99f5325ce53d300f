"""Long runs: what grows, with which power of time, and what does not.

Two things make energy drift. The error of the steps is of one sign where the motion repeats itself:
it grows with time and falls with the tolerance. Rounding adds up as a random walk, with the root of
the number of steps. |p| and the constraints are put back after every step and grow with neither.
"""

import time

import attrs
import numpy as np
import scenes
from support import problems

import dap3d_core as dap
from dap3d_core.model.rotations import rotation
from dap3d_core.scene import Scene

EPS = 2.220446049250313e-16
INERTIA = (1.0, 2.0, 3.0)
#: Reported instants of a run.
REPORTS = 1000
#: Powers of time are fitted from this part of the run on.
FROM = 0.02


@attrs.frozen
class LongRun:
    """A scene, how long it runs, and the settings that are tried: (integrator, settings)."""

    name: str
    scene: Scene
    t_end: float
    tries: tuple[tuple[str, dict[str, float]], ...]


def _tries(steps):
    tolerances = [("dop853", r) for r in (1e-8, 1e-10, 1e-12, 1e-14)]
    tolerances += [("dopri5", 1e-8), ("dopri5", 1e-12), ("radau", 1e-8), ("radau", 1e-10)]
    return (
        *((name, {"rtol": rtol, "atol": rtol / 100.0}) for name, rtol in tolerances),
        *(("dop853", {"step": h}) for h in steps),
    )


def _trees(tolerances, steps):
    """Tries of trees: method joint beside method standard."""
    found = []
    for method in ("standard", "joint"):
        found += [("dop853", {"rtol": r, "atol": r / 100.0, "method": method}) for r in tolerances]
        found += [("dop853", {"step": h, "method": method}) for h in steps]
    return tuple(found)


LONG = (
    LongRun("A01", problems.pendulum(), 1000.0, _tries((0.01, 0.005, 0.0025))),
    LongRun("G1", problems.free_body(INERTIA, (1.0, 2.0, 0.5)), 100.0, _tries((0.02, 0.01, 0.005))),
    LongRun("rod on a hinge", scenes.chain(1, "rev"), 1000.0, _trees((1e-8, 1e-12), (0.01,))),
    LongRun("8 rods on balls", scenes.chain(8), 30.0, _trees((1e-8, 1e-12), (0.002,))),
)


def measure():
    """Rows of all long runs, as JSON has them."""
    return [_row(run, *attempt) for run in LONG for attempt in run.tries]


def simulate(run, integrator, settings):
    """The result of one try, with REPORTS instants after the start."""
    dt = run.t_end / REPORTS
    return dap.simulate(run.scene, t_end=run.t_end, dt=dt, integrator=integrator, **settings)


def drifts(result):
    """Drifts over time (nt,), by name: of energy and angular momentum as parts of their size,
    |C|, the residual of the velocities, ||p| - 1|. Angular momentum for the free body alone."""
    total, kinetic = result.energy.total, result.energy.kinetic
    found = {
        "energy": np.abs(total - total[0]) / kinetic.max(),
        "p": np.abs(np.linalg.norm(result.p, axis=2) - 1.0).max(axis=1),
    }
    if result.summary.row_count:
        found["C"] = result.arrays.position_residual
        found["Cv"] = result.arrays.velocity_residual
    else:
        A = np.array([rotation(p) for p in result.p[:, 0]])
        L = np.einsum("tij,tj->ti", A, INERTIA * result.wp[:, 0])
        found["L"] = np.linalg.norm(L - L[0], axis=1) / np.linalg.norm(L[0])
    return found


def power_of_time(t, drift):
    """The exponent with which the largest drift so far grows; None where it is zero."""
    largest = np.maximum.accumulate(drift)
    late = (t > FROM * t[-1]) & (largest > 0.0)
    if np.count_nonzero(late) < 2:
        return None
    return float(np.polyfit(np.log(t[late]), np.log(largest[late]), 1)[0])


def _row(run, integrator, settings):
    start = time.process_time()
    result = simulate(run, integrator, settings)
    seconds = time.process_time() - start
    how = f"h = {settings['step']:g}" if "step" in settings else f"rtol {settings['rtol']:g}"
    found, steps = drifts(result), result.stats.steps
    return {
        "case": f"{run.name}, {run.t_end:g} s",
        "run": f"{' '.join([integrator, *filter(None, [settings.get('method')])])}, {how}",
        **{name: float(np.max(drift)) for name, drift in found.items()},
        "power": power_of_time(result.t, found["energy"]),
        "roundings": float(np.max(found["energy"])) / (EPS * np.sqrt(steps)),
        "steps": steps,
        "rhs": result.stats.rhs,
        "seconds": seconds,
    }


def draw(path):
    """Draw the drift of energy over time, and what rounding alone would make of it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.0), layout="constrained", sharey=True)
    chosen = ("dop853, rtol 1e-8", "dop853, rtol 1e-12", "dop853, rtol 1e-14", "dop853, fixed h")
    for axis, run, step in zip(axes, LONG[:2], (0.005, 0.01), strict=True):
        tries = [("dop853", {"rtol": r, "atol": r / 100}) for r in (1e-8, 1e-12, 1e-14)]
        for label, attempt in zip(chosen, [*tries, ("dop853", {"step": step})], strict=True):
            result = simulate(run, *attempt)
            found = drifts(result)
            drift = np.maximum.accumulate(found["energy"])
            axis.loglog(result.t[1:], np.maximum(drift[1:], 1e-17), label=label, lw=1.2)
        steps = result.stats.steps * result.t / result.t[-1]
        axis.loglog(result.t[1:], EPS * np.sqrt(steps[1:]), "k--", lw=0.8, label="eps √steps")
        held = found.get("C", found["p"])
        axis.loglog(result.t[1:], np.maximum(held[1:], 1e-17), ".", ms=1.5, color="0.6",
                    label="|C| (A01), ||p| − 1| (G1)")  # fmt: skip
        axis.set_title(f"{run.name}, {run.t_end:g} s", fontsize=9)
        axis.set_xlabel("t, s", fontsize=8)
        axis.tick_params(labelsize=7)
        axis.set_ylim(5e-18, 1e-5)
    axes[0].set_ylabel("largest drift of energy so far", fontsize=8)
    axes[1].legend(fontsize=6, loc="upper left")
    figure.savefig(path, dpi=110)
    plt.close(figure)
