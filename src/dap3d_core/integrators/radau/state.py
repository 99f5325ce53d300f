"""The state of an implicit integration: arrays that the compiled core reads and writes."""

from collections.abc import Container
from typing import Any

import attrs

from dap3d_core.assembly.arrays import System
from dap3d_core.integrators.radau.tableau import MOST_STAGES, RadauMethod
from dap3d_core.integrators.stepping.integration_state import STATES, IntegrationState
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import (
    ComplexMatrix,
    IntegerMatrix,
    Matrix,
    Scalar,
    Tensor,
)

# Rows of ``state`` behind those of stepping/integration_state.py: state before the last step, dy/dt
# at Y, there, and at the trial state.
OLD, SLOPE, OLD_SLOPE, TRIAL_SLOPE, RADAU_STATES = range(STATES, STATES + 5)
#: Rows of ``terms``: dense output is a polynomial of degree 5, or of one more than the stages.
TERMS = MOST_STAGES + 2
#: Columns of ``tolerances``: relative tolerance of the error estimate, limit of the iteration, and
#: from there on absolute tolerances.
RTOL, LIMIT, ATOL = range(3)


#: Values of its integers between two chunks of a run, as ``allowed_integers`` has them.
ALLOWED: dict[str, Container[int]] = {
    **dict.fromkeys(("tangent_needed", "tangent_is_current", "has_last_step"), (0, 1)),
    "dense_degree": range(TERMS),
}

#: What a part of a step is given: system, loops, tangent, and the matrix of the stages; in joint
#: coordinates functions in place of the matrix.
Given = tuple[System, Any, Any, Any]


def _own() -> Scalar[float]:
    return Scalar("own")


def _integer() -> Scalar[int]:
    return Scalar("integer")


@attrs.define(eq=False, kw_only=True, slots=False)
class RadauState(IntegrationState):
    """State of an implicit integration, besides system, tangent and matrix.

    n = 13 bodies + 1 components, R rows, N unknowns, up to S stages, P pairs of complex poles; mu
    and lambda are the two multipliers of each row, C and D v - nu its two residuals.
    """

    convergence_factor = _own()  # eta and Theta of HW II, IV.8, (8.10)
    convergence_rate = _own()
    accepted_step = _own()  # length of the last accepted step
    factored_step = _own()  # length of the step that the factors belong to
    tangent_step = _own()  # length of the step that the tangent is asked for
    accepted_error = _own()  # of the last accepted step
    regularisation = _own()  # of the rows; 0: none
    newton_limit = _own()  # norm of a change at which the iteration ends
    state_change = _own()  # norms of the last change of the stages and of their multipliers
    multiplier_change = _own()

    tangent_needed = _integer()  # before the next step
    tangent_is_current = _integer()  # that of the present state
    has_last_step = _integer()
    iteration_count = _integer()
    last_iterations = _integer()
    jacobian_count = _integer()
    factorisation_count = _integer()
    stages = _integer()
    last_stages = _integer()  # of the last accepted step
    steps_at_order = _integer()  # accepted since the order changed
    patience = _integer()  # steps of an order before it may rise again
    dense_degree = _integer()
    error_refusals = _integer()  # steps refused for their error, as the iteration did not converge,
    iteration_refusals = _integer()  # and as a matrix was singular
    singular_refusals = _integer()

    own: Floats  # scalars
    k: Matrix  # (2, n) for the first step
    terms: Matrix  # (TERMS, n)
    nodes: Floats  # (TERMS,) of dense output, in Newton's form
    tolerances: Matrix  # (orders, ATOL + n) RTOL, ...
    counts: Integers  # (3,) coordinates, their rates, states of elements
    blamed: Floats  # (n,) how often each changed most where the iteration did not converge
    Z: Matrix  # (S, n) stages less the state
    Z_old: Matrix  # (S, n) of the last accepted step
    F: Matrix  # (S, n) rates at the stages
    R: Matrix  # (S, n) residuals; then changes
    multipliers: Tensor  # (S, 2, R) at the stages
    last_multipliers: Tensor  # (S, 2, R) of the last accepted step
    G: Tensor  # (S, 2, R) residuals of the rows; then changes
    frames: Tensor  # (S, bodies + 1, 13) axes and Euler parameters of the bodies at the stages
    x: Matrix  # (S, N) residuals, changes in the unknowns of the matrix
    along: Matrix  # (S, bodies + 1) their parts along the Euler parameters
    xr: Floats  # (N,) of the real system
    alongr: Floats  # (bodies + 1,)
    xc: ComplexMatrix  # (P, N) complex
    alongc: ComplexMatrix  # (P, bodies + 1) complex
    K: Floats  # (matrix_size,)
    Kc: ComplexMatrix  # (P, matrix_size) complex
    pivots: Integers  # (N,)
    pivotsc: IntegerMatrix  # (P, N)
    method: RadauMethod
