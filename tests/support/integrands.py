"""Right-hand sides with known solutions for the tests of the integrators."""

import math
from functools import cache

import numpy as np

from dap3d_core.integrators import TABLEAUS, RungeKutta, Status
from support.internals import DTYPES, Array, System, compiled, loop_list, step_functions

# The system is an empty one of the core, whose integrators are compiled for it already; its
# ``force`` counts the calls of rhs, project and report.


def oscillator(t, y, out, system, loops):
    """y'' = -y in pairs; further components are the integral of the first."""
    system.force[0] += 1
    out[0], out[1] = y[1], -y[0]
    for i in range(2, y.size):
        out[i] = 1e6 * y[0]


def kepler(t, y, out, system, loops):
    system.force[0] += 1
    r3 = (y[0] * y[0] + y[1] * y[1]) ** 1.5
    out[0], out[1], out[2], out[3] = y[2], y[3], -y[0] / r3, -y[1] / r3


def time_dependent(t, y, out, system, loops):
    """y = exp(sin t) by two roads."""
    system.force[0] += 1
    out[0] = y[0] * math.cos(t)
    out[1] = math.exp(math.sin(t)) * math.cos(t)


def nan_after_one(t, y, out, system, loops):
    system.force[0] += 1
    out[0] = math.cos(t) if t <= 1.0 else np.nan


def blow_up(t, y, out, system, loops):
    """y = 1 / (1 - t)."""
    system.force[0] += 1
    out[0] = y[0] * y[0]


def spiral(t, y, out, system, loops):
    """Turns at unit rate and grows; on the unit circle it is (cos t, sin t)."""
    system.force[0] += 1
    out[0], out[1] = -y[1] + 0.1 * y[0], y[0] + 0.1 * y[1]


def no_constraint(t, y, out, system, loops):
    system.force[1] += 1
    out[0] = 0.0


def circle(t, y, out, system, loops):
    system.force[1] += 1
    r = np.sqrt(y[0] * y[0] + y[1] * y[1])
    y[0], y[1] = y[0] / r, y[1] / r
    out[0] = 1.0 if abs(r - 1.0) > 1e-14 else 0.0


def circle_until_one(t, y, out, system, loops):
    system.force[1] += 1
    out[1] = 1.0 if t > 1.0 else 0.0


def plain_report(t, y, out, system, loops):
    system.force[2] += 1
    for i in range(out.size):
        out[i] = (i + 1) * t * y[0]


def report_until_one(t, y, out, system, loops):
    system.force[2] += 1
    out[0] = 1.0 if t < 1.0 else np.inf


compile_once = cache(compiled)


def first_class(*functions):
    """The list of functions that an integrator takes."""
    return step_functions(*(compile_once(function) for function in functions))


def counting(calls):
    """A system without bodies that counts calls."""
    empty = {
        name: np.zeros((0,) * type_.ndim, DTYPES[type_.item]) if isinstance(type_, Array) else None
        for name, type_ in System.type_of().members
    }
    return System(**empty | {"force": calls})


def start(name, rhs, y0, times, project=no_constraint, report=plain_report, **options):
    """An integration of a toy; its calls are counted in ``.calls``."""
    functions, calls = first_class(rhs, project, report), np.zeros(3)
    system = counting(calls)
    run = RungeKutta(TABLEAUS[name], functions, system, loop_list([]), y0, times, **options)
    run.calls = calls
    return run


def finish(run, budget=10**9):
    """Rows of a whole run, in chunks."""
    parts = []
    while run.status is Status.RUNNING:
        run.advance(budget)
        parts.append(run.rows())
    return np.concatenate(parts)


def kepler_orbit(t, e=0.3):
    """Position and velocity (k, 4) from pericentre, unit semi-major axis, by Kepler's equation."""
    t = np.asarray(t, dtype=float)
    E = t.copy()
    for _ in range(60):
        E -= (E - e * np.sin(E) - t) / (1.0 - e * np.cos(E))
    s, rate = np.sqrt(1.0 - e * e), 1.0 / (1.0 - e * np.cos(E))
    return np.stack(
        [np.cos(E) - e, s * np.sin(E), -np.sin(E) * rate, s * np.cos(E) * rate], axis=-1
    )


def kepler_f(t, y):
    """The Kepler problem as scipy wants it."""
    return np.concatenate([y[2:], -y[:2] / np.hypot(*y[:2]) ** 3])


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


ALL, ADAPTIVE = ("rk4", "dopri5", "dop853"), ("dopri5", "dop853")
TIGHT = {"rtol": 1e-11, "atol": 1e-11}
