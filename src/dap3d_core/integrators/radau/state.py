"""The state of an implicit integration: arrays that the compiled core reads and writes."""

from collections.abc import Container
from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.radau.tableau import RadauMethod
from dap3d_core.integrators.stepping.integration_state import MOST_COUNTED, STATES, IntegrationState
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import COMPLEX_VECTOR, MATRIX, TENSOR, Scalar
from dap3d_core.kernels.runtime.array_struct import INTEGERS as INTEGER_VECTOR

# Rows of ``state`` behind those of stepping/integration_state.py: state before the last step, dy/dt
# at Y, there, and at the trial state.
OLD, SLOPE, OLD_SLOPE, TRIAL_SLOPE, RADAU_STATES = range(STATES, STATES + 5)
#: Rows of ``terms``: dense output is a polynomial of degree 5.
TERMS = 6


#: Values of its integers between two chunks of a run, as ``allowed_integers`` has them.
ALLOWED: dict[str, Container[int]] = {
    **dict.fromkeys(("tangent_needed", "tangent_is_current", "has_last_step"), (0, 1)),
    **dict.fromkeys(
        ("iteration_count", "last_iterations", "jacobian_count", "factorisation_count"),
        range(MOST_COUNTED),
    ),
}


def _own() -> Scalar[float]:
    return Scalar("own")


def _integer() -> Scalar[int]:
    return Scalar("integer")


@attrs.define(eq=False, kw_only=True, slots=False)
class RadauState(IntegrationState):
    """State of an implicit integration, besides system, tangent and matrix.

    n = 13 bodies + 1 components, R rows, N unknowns; mu and lambda are the two multipliers of each
    row, C and D v - nu its two residuals.
    """

    types: ClassVar[dict[str, Any]] = {
        **IntegrationState.types,
        **dict.fromkeys(("pivots", "pivotsc"), INTEGER_VECTOR),
        **dict.fromkeys(("k", "terms", "Z", "Z_old", "F", "R", "x", "along"), MATRIX),
        **dict.fromkeys(("multipliers", "last_multipliers", "G", "frames"), TENSOR),
        **dict.fromkeys(("xc", "alongc", "Kc"), COMPLEX_VECTOR),
        "method": RadauMethod.type_of(),
    }

    convergence_factor = _own()  # eta and Theta of HW II, IV.8, (8.10)
    convergence_rate = _own()
    accepted_step = _own()  # length of the last accepted step
    factored_step = _own()  # length of the step that the factors belong to
    tangent_step = _own()  # length of the step that the tangent is asked for
    accepted_error = _own()  # of the last accepted step
    regularisation = _own()  # of the rows; 0: none
    state_change = _own()  # norms of the last change of the stages and of their multipliers
    multiplier_change = _own()

    tangent_needed = _integer()  # before the next step
    tangent_is_current = _integer()  # that of the present state
    has_last_step = _integer()
    iteration_count = _integer()
    last_iterations = _integer()
    jacobian_count = _integer()
    factorisation_count = _integer()

    own: Floats  # scalars
    k: Floats  # (2, n) for the first step
    terms: Floats  # (TERMS, n)
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
