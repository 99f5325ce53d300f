"""A chaotic double pendulum: until when digits remain, as estimated and as it is.

The motion itself comes from tests/support/double_pendulum.py, to 34 digits, of which it loses one
every two seconds.
"""

from functools import cache

import numpy as np
from support import double_pendulum, problems

import dap3d_core as dap
from dap3d_core.result.post.global_error import MEANINGLESS

T_END, DT, DIGITS = 30.0, 0.1, 34
TRIES = (
    ("dop853", {"rtol": 1e-4, "atol": 1e-6}),
    ("dop853", {"rtol": 1e-6, "atol": 1e-8}),
    ("dop853", {}),
    ("dop853", {"rtol": 1e-10, "atol": 1e-12}),
    ("dop853", {"rtol": 1e-12, "atol": 1e-14}),
    ("dopri5", {}),
    ("adams", {}),
    ("radau", {}),
    ("rk4", {"step": 1e-3}),
)


@cache
def reference():
    """Times, and (nt, 2) places of the outer rod's mass centre."""
    t = np.round(np.arange(0.0, T_END + 0.5 * DT, DT), 6)
    s1, c1, _, s2, c2, _ = np.array(double_pendulum.states(t, digits=DIGITS), dtype=float).T
    return t, np.column_stack([s1 + 0.5 * s2, -c1 - 0.5 * c2])


def simulate(integrator, settings):
    """One run with its estimate."""
    return dap.simulate(
        problems.chain(2), t_end=T_END, dt=DT, integrator=integrator, estimate_error=True,
        **settings,
    )  # fmt: skip


def errors(result):
    """(nt,) estimated and true error of the outer rod's mass centre, m."""
    true = np.linalg.norm(result.r[:, 1, :2] - reference()[1], axis=1)
    return np.linalg.norm(result.error.r[:, 1], axis=1), true


def parted(result, true):
    """The first instant at which the true error is beyond 1e-3 of the size, or None."""
    lost = true > MEANINGLESS * result.error.size["r"]
    return float(result.t[np.argmax(lost)]) if lost.any() else None


def measure():
    """A row for each try."""
    return [_row(*attempt) for attempt in TRIES]


def _row(integrator, settings):
    result = simulate(integrator, settings)
    estimate, true = errors(result)
    when = result.error.meaningless_from
    told = (result.t > 0.0) & (result.t < (np.inf if when is None else when))
    ratio = estimate[told] / true[told]
    step, rtol = settings.get("step"), settings.get("rtol", 1e-8)
    return {
        "case": "double pendulum",
        "run": f"{integrator}, h = {step:g}" if step else f"{integrator}, rtol {rtol:g}",
        "steps": result.stats.steps,
        "meaningless_from": when,
        "parted": parted(result, true),
        "tenfold": result.error.tenfold,
        "least_ratio": float(np.min(ratio)),
        "median_ratio": float(np.median(ratio)),
        "largest_ratio": float(np.max(ratio)),
        "energy": result.ledger["energy"].value,
    }


def draw(path):
    """Draw the estimated and the true error over time, at three tolerances."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(7.5, 3.4), layout="constrained")
    for color, rtol in zip(("tab:red", "tab:blue", "tab:green"), (1e-4, 1e-8, 1e-12), strict=True):
        result = simulate("dop853", {"rtol": rtol, "atol": rtol / 100.0})
        estimate, true = errors(result)
        axis.semilogy(result.t[1:], true[1:], color=color, lw=1.4, label=f"rtol {rtol:g}, true")
        axis.semilogy(result.t[1:], estimate[1:], ":", color=color, lw=1.4, label="estimated")
        axis.axvline(result.error.meaningless_from, color=color, lw=0.8, ls="--")
    axis.axhline(MEANINGLESS * result.error.size["r"], color="0.5", lw=0.8)
    axis.text(0.2, 2.2e-3, "1e-3 of the size", fontsize=7, color="0.35")
    axis.set_xlabel("t, s", fontsize=8)
    axis.set_ylabel("error of the outer rod, m", fontsize=8)
    axis.set_title("double pendulum; dashed lines: said to mean nothing from there on", fontsize=9)
    axis.tick_params(labelsize=7)
    axis.set_ylim(1e-14, 10.0)
    axis.set_xlim(0.0, T_END)
    axis.legend(fontsize=6.5, loc="lower right", ncols=3)
    figure.savefig(path, dpi=110)
    plt.close(figure)
