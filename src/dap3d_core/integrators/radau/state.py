"""The state of an implicit integration: arrays that the compiled core reads and writes."""

from collections.abc import Container
from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.radau.tableau import RadauMethod
from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers
from dap3d_core.integrators.stepping.integration_state import INTEGERS, MOST_COUNTED, STATES
from dap3d_core.kernels.runtime.array_struct import COMPLEX_VECTOR, MATRIX, TENSOR, Arrays
from dap3d_core.kernels.runtime.array_struct import INTEGERS as INTEGER_VECTOR

# Places in ``own``. FACCON and THETA: as in HW II, IV.8, (8.10); length of the last accepted step,
# and of the one the factors belong to; error of the last accepted step; what regularises the rows
# (0: nothing); norms of the last change of the stages and of their multipliers.
(
    FACCON, THETA, H_ACCEPTED, H_FACTORED, ERROR_ACCEPTED, PART, OF_STATES, OF_MULTIPLIERS, OWN
) = range(9)  # fmt: skip
# Places in ``integer`` behind those of stepping/integration_state.py. TANGENT_NEEDED: before the
# next step; TANGENT_HERE: the tangent is that of the present state; ACCEPTED: there is a step
# before; what follows counts.
(
    TANGENT_NEEDED,
    TANGENT_HERE,
    ACCEPTED,
    ITERATIONS,
    LAST_ITERATIONS,
    JACOBIANS,
    FACTORISATIONS,
) = range(INTEGERS, INTEGERS + 7)
RADAU_INTEGERS = INTEGERS + 7
#: What these places may hold between two chunks of a run, as ``work.allowed_integers``.
ALLOWED: dict[int, Container[int]] = {
    **dict.fromkeys((TANGENT_NEEDED, TANGENT_HERE, ACCEPTED), (0, 1)),
    **dict.fromkeys(range(ITERATIONS, RADAU_INTEGERS), range(MOST_COUNTED)),
}
# Rows of ``state`` behind those of stepping/integration_state.py: state before the last step, dy/dt
# at Y, there, and at the trial state.
OLD, SLOPE, OLD_SLOPE, TRIAL_SLOPE, RADAU_STATES = range(STATES, STATES + 5)
#: Rows of ``terms``: dense output is a polynomial of degree 5.
TERMS = 6


@attrs.frozen(eq=False, kw_only=True, slots=False)
class RadauWork(Arrays):
    """All that ``advance`` reads and writes besides system, tangent and matrix.

    n = 13 bodies + 1 components, R rows, N unknowns; mu and lambda are the two multipliers of each
    row, C and D v - nu its two residuals.
    """

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("integer", "pivots", "pivotsc"), INTEGER_VECTOR),
        **dict.fromkeys(("state", "k", "terms", "rows", "switches", "crossings", "tolerance",
                         "Z", "Z_old",
                         "F", "R", "x", "along"), MATRIX),
        **dict.fromkeys(("multipliers", "last_multipliers", "G", "frames"), TENSOR),
        **dict.fromkeys(("xc", "alongc", "Kc"), COMPLEX_VECTOR),
        "method": RadauMethod.type_of(),
    }  # fmt: skip

    real: Floats  # (LENGTHS + m,) as in work.Work
    own: Floats  # (OWN,)
    integer: Integers  # (RADAU_INTEGERS,)
    times: Floats  # (nt,) as in work.Work
    state: Floats  # (RADAU_STATES, n)
    k: Floats  # (2, n) for the first step
    terms: Floats  # (TERMS, n)
    rows: Floats  # (capacity, 1 + n + report_size)
    switches: Floats  # as in work.Work
    crossings: Floats
    tolerance: Floats
    Z: Floats  # (3, n) stages less the state
    Z_old: Floats  # (3, n) of the last accepted step
    F: Floats  # (3, n) rates at the stages
    R: Floats  # (3, n) residuals; then changes
    multipliers: Floats  # (3, 2, R) at the stages
    last_multipliers: Floats  # (3, 2, R) of the last accepted step
    G: Floats  # (3, 2, R) residuals of the rows; then changes
    frames: Floats  # (3, bodies + 1, 13) axes and Euler parameters of the bodies at the stages
    x: Floats  # (3, N) residuals, changes in the unknowns of the matrix
    along: Floats  # (3, bodies + 1) their parts along the Euler parameters
    xr: Floats  # (N,) of the real system
    alongr: Floats  # (bodies + 1,)
    xc: Any  # (N,) complex
    alongc: Any  # (bodies + 1,) complex
    K: Floats  # (matrix_size,)
    Kc: Any  # (matrix_size,) complex
    pivots: Integers  # (N,)
    pivotsc: Integers  # (N,)
    method: RadauMethod
