"""The state of an integration by an explicit Runge-Kutta method."""

from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.stepping.integration_state import IntegrationState
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import MATRIX


@attrs.define(eq=False, kw_only=True, slots=False)
class RungeKuttaState(IntegrationState):
    """State of an integration; n components, S stages (tableau.Tableau)."""

    types: ClassVar[dict[str, Any]] = {
        **IntegrationState.types,
        **dict.fromkeys(("k", "terms", "table", "lengths"), MATRIX),
    }

    k: Floats  # (S, n) stages; k[0] is f(t, y)
    terms: Floats  # (4 + rows of d, n) of the dense output over the last step
    table: Floats  # tableau.combinations
    lengths: Floats  # (ROWS, m) singularity measures (stepping/singular_poses.py)
