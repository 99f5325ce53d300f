"""The parts of a Radau step as first-class functions, each compiled by itself.

A compiled function that calls another one takes in its code, and optimises it again; calls by
pointer keep the parts apart.
"""

from typing import Any

from dap3d_core.assembly.system import System
from dap3d_core.formulations.stage import Matrix
from dap3d_core.formulations.tangent import Tangent
from dap3d_core.integrators.radau_dense import find_slope
from dap3d_core.integrators.radau_newton import (
    estimate_error,
    factorise_both,
    find_stages,
    find_tangent,
)
from dap3d_core.integrators.radau_work import RadauWork
from dap3d_core.kernels.cache import table_of
from dap3d_core.kernels.lists import LOOP_LIST, number_signature

PART = number_signature(
    RadauWork.type_of(), System.type_of(), LOOP_LIST, Tangent.type_of(), Matrix.type_of()
)


def radau_parts() -> Any:
    """find_tangent, factorise_both, find_stages, estimate_error, find_slope as a table.

    Each is called as part(t, h, work, system, loops, tangent, matrix).
    """
    parts = (find_tangent, factorise_both, find_stages, estimate_error, find_slope)
    return table_of(PART, parts)
