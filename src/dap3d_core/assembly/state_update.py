"""Changes of a state: displacements, changes of velocity, in the bodies' scaled coordinates."""

import numpy as np

from dap3d_core.assembly.arrays import LENGTH, Floats, System, coordinate_offset, velocity_offset
from dap3d_core.assembly.metric import unscaled
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where


@compiled
def normalise(y: Floats, system: System) -> None:
    """Bring the Euler parameters of the bodies to unit length."""
    for b in range(1, system.body.shape[0]):
        c = coordinate_offset(b) + 3
        e0, e1, e2, e3 = y[c], y[c + 1], y[c + 2], y[c + 3]
        h = 1.0 / np.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
        for d in range(c, c + 4):
            y[d] *= h


@compiled
def add_displacement(y: Floats, metric: Floats, change: Floats, out: Floats) -> None:
    """Add r and p's share of a scaled displacement (or its rate); out may be y."""
    for b in range(1, metric.shape[0]):
        c, o, k = coordinate_offset(b), 6 * b, metric[b]
        w0, w1, w2 = unscaled(k, change[o + 3], change[o + 4], change[o + 5])
        w0, w1, w2 = 0.5 * w0, 0.5 * w1, 0.5 * w2
        e0, e1, e2, e3 = y[c + 3], y[c + 4], y[c + 5], y[c + 6]
        for d in range(3):
            out[c + d] += k[0] * change[o + d]
        out[c + 3] += -e1 * w0 - e2 * w1 - e3 * w2
        out[c + 4] += e0 * w0 - e3 * w1 + e2 * w2
        out[c + 5] += e3 * w0 + e0 * w1 - e1 * w2
        out[c + 6] += -e2 * w0 + e1 * w1 + e0 * w2


@compiled
def add_velocity(metric: Floats, change: Floats, out: Floats) -> None:
    """Add a scaled velocity to the velocities (6 n,)."""
    for b in range(1, metric.shape[0]):
        f, o, k = 6 * (b - 1), 6 * b, metric[b]
        w0, w1, w2 = unscaled(k, change[o + 3], change[o + 4], change[o + 5])
        for d in range(3):
            out[f + d] += k[0] * change[o + d]
        out[f + 3] += w0
        out[f + 4] += w1
        out[f + 5] += w2


@compiled
def apply_displacement(y: Floats, system: System) -> None:
    """Add the scaled ``change``: r += dr, p += 1/2 L^T dtheta', of unit length again."""
    add_displacement(y, system.metric, system.change, y)
    normalise(y, system)


@compiled
def apply_velocity_change(y: Floats, metric: Floats, change: Floats) -> None:
    """Add a scaled change of velocity to the velocities."""
    add_velocity(metric, change, y[velocity_offset(1, metric.shape[0] - 1) :])


@compiled
def size_of_positions(y: Floats, system: System) -> float:
    """The length of the scene and the largest coordinate of bodies: scale of a tolerance, m."""
    found = 0.0
    for b in range(1, system.body.shape[0]):
        first = coordinate_offset(b)
        for c in range(first, first + 3):
            found = where(abs(y[c]) > found, abs(y[c]), found)
    return system.settings[LENGTH] + found


@compiled
def size_of_velocities(y: Floats, system: System) -> float:
    """The same of velocities, m/s: of a radian that length."""
    n, length, found = system.body.shape[0] - 1, system.settings[LENGTH], 0.0
    for b in range(1, n + 1):
        f = velocity_offset(b, n)
        for c in range(3):
            v, w = abs(y[f + c]), length * abs(y[f + 3 + c])
            found = where(v > found, v, found)
            found = where(w > found, w, found)
    return length + found
