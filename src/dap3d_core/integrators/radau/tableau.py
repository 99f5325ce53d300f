"""Coefficients of Radau IIA with three stages, order 5, and of the transformation of its systems.

Source: Hairer, Wanner, Solving Ordinary Differential Equations II (HW), IV.5 (table 5.6) and IV.8,
and their code RADAU5.
"""

from functools import cache
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import MATRIX, Arrays

STAGES = 3
#: Order of the method, and of its error estimate plus one.
ORDER, ERROR_ORDER = 5, 4


@attrs.frozen(eq=False, kw_only=True, slots=False)
class RadauMethod(Arrays):
    """Radau IIA; T^-1 A^-1 T = [[gamma, 0, 0], [0, alpha, -beta], [0, beta, alpha]]."""

    types: ClassVar[dict[str, Any]] = dict.fromkeys(("A", "inverse", "T", "T_inverse"), MATRIX)

    c: Floats  # (3,) abscissae
    A: Floats  # (3, 3); its last row holds the weights
    inverse: Floats  # (3, 3) A^-1
    T: Floats  # (3, 3)
    T_inverse: Floats  # (3, 3)
    e: Floats  # (3,) weights of the stages in the error estimate
    poles: Floats  # (3,) gamma, alpha, beta


@cache
def radau_method() -> RadauMethod:
    """The coefficients, from those of A."""
    q = np.sqrt(6.0)
    A = np.array(
        [
            [(88 - 7 * q) / 360, (296 - 169 * q) / 1800, (-2 + 3 * q) / 225],
            [(296 + 169 * q) / 1800, (88 + 7 * q) / 360, (-2 - 3 * q) / 225],
            [(16 - q) / 36, (16 + q) / 36, 1 / 9],
        ]
    )
    inverse = np.linalg.inv(A)
    values, vectors = np.linalg.eig(inverse)
    real, pair = np.argmin(np.abs(values.imag)), np.argmin(values.imag)  # alpha - i beta
    vectors = vectors / vectors[2]  # the last row of T is (1, 1, 0)
    T = np.column_stack([vectors[:, real].real, vectors[:, pair].real, vectors[:, pair].imag])
    poles = np.array([values[real].real, values[pair].real, -values[pair].imag])
    e = np.array([-(13 + 7 * q) / 3, (-13 + 7 * q) / 3, -1 / 3])
    c = np.array([(4 - q) / 10, (4 + q) / 10, 1.0])
    return RadauMethod(
        c=c,
        A=A,
        inverse=inverse,
        T=np.ascontiguousarray(T),
        T_inverse=np.linalg.inv(T),
        e=e,
        poles=poles,
    )
