"""Explicit Runge-Kutta methods as data: coefficients, and parameters that control the step."""

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike

from dap3d_core.kernels.array_types import Floats


def _read_only(rows: ArrayLike) -> Floats:
    array = np.array(rows, dtype=np.float64)
    array.flags.writeable = False
    return array


def lower_triangle(*rows: Sequence[float]) -> Floats:
    """Square matrix whose rows below the first are given, each as far as it goes; the rest is 0."""
    matrix = np.zeros((len(rows) + 1, len(rows) + 1))
    for i, row in enumerate(rows, start=1):
        matrix[i, : len(row)] = row
    return matrix


@frozen(eq=False)
class Tableau:
    """An explicit Runge-Kutta method as data; one algorithm (step.py) serves them all.

    With s stages, row s of the tableau holds the weights b of the result and ``k[s]`` is f at the
    result: the first stage of the next step. Rows beyond are the stages that dense output needs
    besides. Notation of Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.
    """

    name: str
    order: int
    #: Number s of stages before the result.
    stages: int
    #: (S,) abscissae; S counts the stages, the result and the further stages of dense output.
    c: Floats = field(converter=_read_only, repr=False)
    #: (S, S) coefficients, below the diagonal.
    a: Floats = field(converter=_read_only, repr=False)
    #: (0, 1 or 2; S) error weights: none (fixed steps only), one estimate, or those of order 5 and
    #: 3 that are combined as in DOP853.
    e: Floats = field(converter=_read_only, repr=False)
    #: (rows, S) weights of the higher terms of dense output; no row: none, so that fixed steps end
    #: at each reporting time.
    d: Floats = field(converter=_read_only, repr=False)
    #: The controller divides h by err^exponent / err_old^beta / safety, between the two factors.
    exponent: float = 0.0
    beta: float = 0.0
    factor_min: float = 1.0
    factor_max: float = 1.0
    safety: float = 0.9

    @property
    def adaptive(self) -> bool:
        """True if the method estimates its error and so can choose its step."""
        return len(self.e) > 0

    @property
    def dense(self) -> bool:
        """True if the method has dense output."""
        return len(self.d) > 0

    @property
    def widest_gap_abscissa(self) -> float:
        """The middle of the widest gap between the abscissae of the stages: nothing is sampled."""
        c = np.sort(self.c[: self.stages])
        widest = int(np.argmax(np.diff(c)))
        return float(0.5 * (c[widest] + c[widest + 1]))

    @property
    def stiffness_stage(self) -> int:
        """The last stage before the result at the end of the step; 0: none."""
        return max(i for i in range(self.stages) if i == 0 or self.c[i] == 1.0)

    @property
    def error_uses_last_stage(self) -> bool:
        """True if the error estimate needs f at the result of the step."""
        return self.adaptive and bool(np.any(self.e[:, self.stages] != 0.0))
