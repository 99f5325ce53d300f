"""Integrations that begin at a singular state."""

import numpy as np

from dap3d_core.integrators.runge_kutta.tableau import Floats
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Work
from dap3d_core.integrators.stepping.singular_poses import NOW, RATE


def begin_singular(work: Work, slope: Floats, first_step: float) -> None:
    """Give an integration the rates (n,) at its start, which are not those of its functions there.

    The first step is one of those near a singular state, with its stages on the constraints, and
    as long as may be: close to the state rates are known the worse.
    """
    work.k[0], work.real[at.H] = slope, first_step
    work.integer[at.FRESH] = 1
    work.lengths[NOW], work.lengths[RATE] = 0.0, np.finfo(float).tiny
