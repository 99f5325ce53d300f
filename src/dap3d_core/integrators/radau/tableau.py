"""Coefficients of Radau IIA with 3, 5 and 7 stages, and of the transformation of its systems.

All follow from the abscissae: derivatives and integrals of the polynomials that are one at one of
them. Source: Hairer, Wanner, Solving Ordinary Differential Equations II (HW), IV.5 and IV.8; Stiff
differential equations solved by Radau methods (J. Comp. Appl. Math. 111, 1999), and their code
RADAU.
"""

from functools import cache
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import MATRIX, TENSOR, Arrays

#: Numbers of stages; a method of s stages has order 2 s - 1, and its error estimate order s.
STAGES = (3, 5, 7)
FEWEST, MOST_STAGES, METHODS = STAGES[0], STAGES[-1], len(STAGES)
ORDERS = tuple(2 * s - 1 for s in STAGES)
#: Roots of d^(s-1)/dx^(s-1) [x^(s-1) (x - 1)^s].
ABSCISSAE = (
    (0.15505102572168219, 0.6449489742783178, 1.0),
    (0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562194, 1.0),
    (0.029316427159784892, 0.1480785996684843, 0.3369846902811543, 0.5586715187715501,
     0.7692338620300545, 0.9269456713197411, 1.0),
)  # fmt: skip


@attrs.frozen(eq=False, kw_only=True, slots=False)
class RadauMethod(Arrays):
    """Radau IIA with 3, 5 and 7 stages, padded with zeros to 7.

    T^-1 A^-1 T has the real pole gamma, and for each pair of poles a block
    [[alpha, -beta], [beta, alpha]].
    """

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("c", "e", "bulge", "poles"), MATRIX),
        **dict.fromkeys(("A", "inverse", "T", "T_inverse"), TENSOR),
    }

    c: Floats  # (3, 7) abscissae
    A: Floats  # (3, 7, 7); its last row holds the weights
    inverse: Floats  # (3, 7, 7) A^-1
    T: Floats  # (3, 7, 7)
    T_inverse: Floats  # (3, 7, 7)
    e: Floats  # (3, 7) weights of the stages in the error estimate
    bulge: Floats  # (3, 7) integrals of (x - c_1) ... (x - c_s) up to c_i over its value at 0
    poles: Floats  # (3, 7) gamma, then alpha and beta of each pair


def derivatives_at(x: Floats) -> Floats:
    """(n, n) derivatives, at x_i by rows, of the polynomials that are one at x_j, else zero."""
    gaps = x[:, None] - x[None, :]
    np.fill_diagonal(gaps, 1.0)
    weights = 1.0 / np.prod(gaps, axis=1)
    out: Floats = weights[None, :] / weights[:, None] / gaps
    inverse = 1.0 / gaps
    np.fill_diagonal(inverse, 0.0)
    np.fill_diagonal(out, inverse.sum(axis=1))
    return out


def integrals_to(c: Floats) -> tuple[Floats, Floats]:
    """A of the abscissae c, and ``bulge``, by Gauss quadrature that is exact for both."""
    x, w = np.polynomial.legendre.leggauss(len(c))
    at = 0.5 * c[:, None] * (1.0 + x[None, :])  # (i, q) of the interval [0, c_i]
    gaps = at[:, :, None] - c  # (i, q, k)
    spans = c[:, None] - c
    np.fill_diagonal(spans, 1.0)
    others = ~np.eye(len(c), dtype=bool)
    values = np.stack(
        [np.prod(gaps[:, :, others[j]] / spans[j, others[j]], axis=2) for j in range(len(c))]
    )
    A: Floats = np.einsum("jiq,q,i->ij", values, 0.5 * w, c)
    bulge: Floats = np.einsum("iq,q,i->i", np.prod(gaps / -c, axis=2), 0.5 * w, c)
    return A, bulge


def transformation(inverse: Floats) -> tuple[Floats, Floats]:
    """T and the poles of A^-1; the last row of T is (1, 1, 0, 1, 0, ...)."""
    values, vectors = np.linalg.eig(inverse)
    vectors = vectors / vectors[-1]
    real = int(np.argmin(np.abs(values.imag)))
    columns, poles = [vectors[:, real].real], [values[real].real]
    for k in np.argsort(values.imag):
        if values[k].imag < 0.0 and k != real:  # alpha - i beta
            columns += [vectors[:, k].real, vectors[:, k].imag]
            poles += [values[k].real, -values[k].imag]
    return np.column_stack(columns), np.array(poles)


@cache
def radau_method() -> RadauMethod:
    """The coefficients of all three methods."""
    tables = {
        name: np.zeros((METHODS, *[MOST_STAGES] * (RadauMethod.types[name].ndim - 1)))
        for name in RadauMethod.types
    }
    for k, abscissae in enumerate(ABSCISSAE):
        s, c = len(abscissae), np.array(abscissae)
        slopes = derivatives_at(np.append(0.0, c))
        A, bulge = integrals_to(c)
        T, poles = transformation(slopes[1:, 1:])
        found = {"A": A, "inverse": slopes[1:, 1:], "T": T, "T_inverse": np.linalg.inv(T),
                 "c": c, "e": -slopes[0, 1:], "bulge": bulge, "poles": poles}  # fmt: skip
        for name, values in found.items():
            tables[name][k][tuple(slice(s) for _ in values.shape)] = values
    return RadauMethod(**tables)
