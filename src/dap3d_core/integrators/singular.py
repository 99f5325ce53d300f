"""Integrations that begin at a singular state."""

import numpy as np

from dap3d_core.integrators import work as at
from dap3d_core.integrators.crossing import NOW, RATE
from dap3d_core.integrators.method import Floats
from dap3d_core.integrators.work import Work


def begin_singular(work: Work, slope: Floats, first_step: float) -> None:
    """Give an integration the rates (n,) at its start, which are not those of its functions there.

    The first step is one of those near a singular state, with its stages on the constraints, and
    as long as may be: close to the state rates are known the worse.
    """
    work.k[0], work.real[at.H] = slope, first_step
    work.integer[at.FRESH] = 1
    work.lengths[NOW], work.lengths[RATE] = 0.0, np.finfo(float).tiny
