"""Sine and cosine of half of every angle of a tree, many at a time.

Reduction by multiples of pi/2 in three parts and polynomials of fdlibm (k_sin.c, k_cos.c): below
one unit in the last place. There is no branch, so that the loop runs in vectors, and no library, so
that the bits are those of every processor.
"""

import math

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where

# pi/2 in three parts, the first two with trailing zeros, and 2/pi.
P1, P2, P3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
PER = 0.63661977236758134308
# Coefficients of sin r / r and cos r in r^2.
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
#: Half angles up to this magnitude keep all digits in the reduction: k P1 and k P2 are exact.
LARGEST = 1e5


@compiled
def half_angles(q: Floats, sines: Floats, cosines: Floats) -> None:
    """Sines and cosines of q/2 for the first angles of q, as many as there are sines."""
    if not largest_angle(q, sines.shape[0]) < 2.0 * LARGEST:
        for i in range(sines.shape[0]):
            sines[i], cosines[i] = math.sin(0.5 * q[i]), math.cos(0.5 * q[i])
        return
    small_half_angles(q, sines, cosines)


@compiled_into
def largest_angle(q: Floats, count: int) -> float:
    """Largest magnitude of the first angles of q."""
    largest = 0.0
    for i in range(count):
        largest = where(abs(q[i]) > largest, abs(q[i]), largest)
    return largest


@compiled_into
def small_half_angles(q: Floats, sines: Floats, cosines: Floats) -> None:
    """``half_angles`` of angles below twice ``LARGEST``."""
    for i in range(sines.shape[0]):
        x = 0.5 * q[i]
        k = np.rint(x * PER)
        r = ((x - k * P1) - k * P2) - k * P3
        z = r * r
        y = z * z
        s = r + r * z * ((S1 + z * S2) + y * ((S3 + z * S4) + y * (S5 + z * S6)))
        c = (1.0 - 0.5 * z) + y * ((C1 + z * C2) + y * ((C3 + z * C4) + y * (C5 + z * C6)))
        odd = abs(k - 2.0 * np.rint(0.5 * k))  # k mod 2
        half = 0.5 * (k - odd)
        sign = 1.0 - 2.0 * abs(half - 2.0 * np.rint(0.5 * half))  # -1 where k mod 4 > 1
        sines[i] = sign * where(odd == 1.0, c, s)
        cosines[i] = sign * where(odd == 1.0, -s, c)
