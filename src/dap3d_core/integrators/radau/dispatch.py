"""The parts of a Radau step as first-class functions, each compiled separately.

A compiled function that calls another one takes in its code, and optimises it again; calls by
pointer keep the parts apart.
"""

from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.formulations.stabilized_index2.jacobian import Tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import StageMatrix
from dap3d_core.integrators.radau.dense_output import find_slope
from dap3d_core.integrators.radau.newton import (
    estimate_error,
    factorise_both,
    find_stages,
    find_tangent,
)
from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.kernels.runtime.cache import table_of
from dap3d_core.kernels.runtime.function_lists import LOOP_LIST, number_signature

PART = number_signature(
    RadauState.type_of(), System.type_of(), LOOP_LIST, Tangent.type_of(), StageMatrix.type_of()
)


def radau_parts() -> Any:
    """find_tangent, factorise_both, find_stages, estimate_error, find_slope as a table.

    Each is called as part(t, h, work, system, loops, tangent, matrix).
    """
    parts = (find_tangent, factorise_both, find_stages, estimate_error, find_slope)
    return table_of(PART, parts)
