"""States of elements at rest: rate = 0, at a pose or together with it.

At a pose the states follow by Newton's method, the least change where rates leave some of them
open: a bristle at rest keeps its deflection. Forces and stiffness of the search are those with the
states settled,

    K = -dF/dx - dF/dz dz/dx        dz/dx = -(dr/dz)^+ dr/dx,        rates r(x, z).

Rates that no state can bring to zero, as of a controller that integrates its error, need the pose
(balanced_states.py).
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations.common.state_derivatives import StateDerivatives, state_derivatives
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.element_states import ElementState, first_states, width_of

if TYPE_CHECKING:
    from dap3d_core.simulation.linearization.tangent import TangentMatrices


#: Newton steps at most; rates below this part of their terms are zero.
MOST_STEPS, SETTLED = 50, 1e-11
#: Singular values below this part of the largest leave a state open.
OPEN = 1e-10
#: Sizes, m or rad, of what rates depend on besides states, that their terms are measured by.
NEARBY = 1e-3


def settle(evaluator: Evaluator, t: float, u: Floats) -> None:
    """Bring ``evaluator.states`` to where their rates vanish at a pose, as far as they can be."""
    before = np.inf
    best = evaluator.states
    for _ in range(MOST_STEPS):
        own = _derivatives(evaluator, t, u)
        left = unsettled_part(own, evaluator.states)
        if not np.all(np.isfinite(own.rates)) or not left < before:
            evaluator.states = best
            return
        best, before = evaluator.states, left
        if left <= SETTLED:
            return
        evaluator.states = best - _inverse(evaluator, own.rate_by_states) @ own.rates


def moving_states(evaluator: Evaluator, u: Floats) -> list[ElementState]:
    """The states that do not come to rest at a pose."""
    own = _derivatives(evaluator, 0.0, u)
    moves = np.abs(own.rates) > 1e3 * SETTLED * _terms(own, evaluator.states)
    return [s for s in evaluator.model.element_states
            if np.any(moves[s.first : s.first + s.length])]  # fmt: skip


def with_settled(tangent: "TangentMatrices", evaluator: Evaluator) -> "TangentMatrices":
    """A tangent with the stiffness of settled states."""
    own = tangent.states
    if own is None:
        return tangent
    follows = _inverse(evaluator, own.rate_by_states) @ own.rate_by_displacement
    return attrs.evolve(tangent, stiffness=tangent.stiffness + own.force_by_states @ follows)


def _derivatives(evaluator: Evaluator, t: float, u: Floats) -> StateDerivatives:
    model = evaluator.model
    evaluator.place(t, u)
    rest = np.zeros(6 * model.body_count)
    return state_derivatives(evaluator, t, rest, np.zeros(model.row_count), rest)


def _terms(own: StateDerivatives, states: Floats) -> Floats:
    """Sizes of what the rates are sums of."""
    by_states = abs(own.rate_by_states) @ np.abs(states)
    by_motion = abs(own.rate_by_displacement).sum(axis=1) + abs(own.rate_by_velocity).sum(axis=1)
    return by_states + NEARBY * np.asarray(by_motion).ravel()


def unsettled_part(own: StateDerivatives, states: Floats) -> float:
    """Largest rate as a part of its terms, of derivatives at a pose."""
    terms, rates = _terms(own, states), np.abs(own.rates)
    parts = np.where(rates > 0.0, rates / np.where(terms > 0.0, terms, rates + (rates == 0.0)), 0.0)
    return float(np.max(parts, initial=0.0))


def _elements(evaluator: Evaluator) -> Iterator[slice]:
    """The states of each element that has some."""
    for group in evaluator.model.acting:
        if width := width_of(group):
            for first in first_states(evaluator.model.acting, group).tolist():
                yield slice(first, first + width)


def _inverse(evaluator: Evaluator, by_states: Any) -> Any:
    """(s, s) pseudo-inverse of the block-diagonal derivative of rates by states."""
    from scipy.sparse import block_diag, csr_array

    blocks = [_scaled_inverse(by_states[own, own].toarray()) for own in _elements(evaluator)]
    return csr_array(block_diag(blocks, format="csr"))


def _scaled_inverse(matrix: Floats) -> Floats:
    """Pseudo-inverse of a matrix whose rows have units of their own."""
    size = np.max(np.abs(matrix), axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    return np.linalg.pinv(matrix / size, rcond=OPEN) / size.T
