"""The state of an integration by an explicit Runge-Kutta method."""

import attrs

from dap3d_core.integrators.stepping.integration_state import IntegrationState
from dap3d_core.kernels.runtime.array_struct import Matrix


@attrs.define(eq=False, kw_only=True, slots=False)
class RungeKuttaState(IntegrationState):
    """State of an integration; n components, S stages (tableau.Tableau)."""

    k: Matrix  # (S, n) stages; k[0] is f(t, y)
    terms: Matrix  # (4 + rows of d, n) of the dense output over the last step
    table: Matrix  # tableau.combinations
    lengths: Matrix  # (ROWS, m) singularity measures (stepping/singular_poses.py)
