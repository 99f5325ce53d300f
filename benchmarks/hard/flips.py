"""A free body that turns over every 6.6 s, for 1000 s: when it does, by Jacobi's functions.

With J_1 < J_2 < J_3 and L^2 > 2 T J_2 the components of omega are cn, sn and dn of a time tau
(Landau and Lifshitz, Mechanics, section 37): omega_2 is zero at tau = 2 K, 4 K, ...
"""

from functools import cache

import numpy as np
from scipy.special import ellipkinc, ellipkm1
from support import problems

import dap3d_core as dap
from hard.long_time import drifts

J, W = np.array([1.0, 2.0, 3.0]), np.array([0.001, 5.0, 0.001])
T_END = 1000.0
TRIES = (("dop853", 1e-6), ("dop853", 1e-8), ("dop853", 1e-10))


@cache
def instants(t_end=T_END):
    """Instants up to t_end at which omega_2 is zero, from K and an integral of the first kind.

    1 - m is 1e-7 here, so it is formed from what does not cancel: with d_i = L^2 - 2 T J_i,
    1 - m = (J_3 - J_1) d_2 / ((J_3 - J_2) d_1).
    """
    d = np.array([np.sum(J * (J - J_i) * W**2) for J_i in J])
    rate = np.sqrt((J[2] - J[1]) * d[0] / np.prod(J))
    rest = (J[2] - J[0]) * d[1] / ((J[2] - J[1]) * d[0])
    largest = np.sqrt(-d[2] / (J[0] * (J[2] - J[0])))
    # omega_1 = largest cn(K - x) = largest k' sd(x) gives the start; sd^2 = s^2 / (1 - m s^2)
    q = W[0] / (largest * np.sqrt(rest))
    x = ellipkinc(np.arcsin(q / np.sqrt(1.0 + (1.0 - rest) * q * q)), 1.0 - rest)
    quarter = ellipkm1(rest)
    count = int((rate * t_end - x + quarter) // (2.0 * quarter))
    return (x + quarter * (2.0 * np.arange(count) + 1.0)) / rate


def simulate(integrator, rtol, t_end=T_END):
    """A run whose events are the instants at which omega_2 is zero."""
    return dap.simulate(
        problems.free_body(tuple(J), tuple(W)), t_end=t_end, dt=1.0, integrator=integrator,
        rtol=rtol, atol=rtol / 100.0, events=[dap.Event("top.wp.y", at=0.0, name="flip")],
    )  # fmt: skip


def late(result, t_end=T_END):
    """How late each flip is, s; NaN for those that are missing or too many."""
    found, expected = np.array([event.t for event in result.events]), instants(t_end)
    if len(found) != len(expected):
        return np.full(len(expected), np.nan)
    return found - expected


def power(t, lateness):
    """The exponent of time with which the largest lateness so far grows, after a tenth of it."""
    largest = np.maximum.accumulate(np.abs(lateness))
    chosen = t > 0.1 * t[-1]
    return float(np.polyfit(np.log(t[chosen]), np.log(largest[chosen]), 1)[0])


def measure():
    """A row for each try."""
    return [_row(*attempt) for attempt in TRIES]


def _row(integrator, rtol):
    result = simulate(integrator, rtol)
    lateness, found = late(result), drifts(result)
    return {
        "case": "flips, 1000 s",
        "run": f"{integrator}, rtol {rtol:g}",
        "steps": result.stats.steps,
        "flips": len(result.events),
        "first_late": float(abs(lateness[0])),
        "last_late": float(abs(lateness[-1])),
        "late_power": power(instants(), lateness),
        "energy": float(np.max(found["energy"])),
        "L": float(np.max(found["L"])),
        "p": float(np.max(found["p"])),
    }
