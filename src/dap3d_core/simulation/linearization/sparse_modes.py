"""Lowest modes of large scenes, from the sparse equations without independent coordinates.

With y = (x^, v^, lambda, z), z of elements with states, the linearised equations are a pencil
E y_dot = B y, E singular: position rows stand as D x^ = 0, rows of the velocity level alone as
D v^ + G x^ = 0, redundant rows are left out. Arnoldi iterations with (B - sigma E)^-1 E
(scipy.sparse.linalg.eigs, ARPACK) find the eigenvalues nearest to a small real sigma; those at
infinity, which the constraints add, become zero and stay out of the way.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dap3d_core.linear.rank.rank import Dependency
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.linearization.eigenvalues import Eigenvalues, order_of
from dap3d_core.simulation.linearization.scaled_equations import ScaledEquations
from dap3d_core.simulation.linearization.steady_motion import independent_rows

#: sigma as a part of the frequency that the largest terms would give.
SHIFT = 1e-4
#: Eigenvalues below this part of sigma are zeros of rigid motions, which rounding has moved.
ZERO = 1e-3


def lowest_eigenvalues(
    equations: ScaledEquations, dependencies: Sequence[Dependency], count: int
) -> Eigenvalues:
    """The ``count`` eigenvalues nearest to zero, and displacements x^ (6 n, count) of each.

    Raises:
        SimulationError: the iteration does not converge.
    """
    from scipy.sparse import block_array, block_diag, csc_array, eye_array
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

    six = equations.K.shape[0]
    chosen = independent_rows(equations.D.shape[0], dependencies)
    position = equations.position_row[chosen]
    D, G, F = equations.D[chosen], equations.G[chosen], equations.F[:, chosen]
    identity = eye_array(six)
    on_x = D.multiply(position[:, None]) + G.multiply(~position[:, None])
    on_v = D.multiply(~position[:, None])
    terms = [[equations.S, identity, None],
                [-equations.K, -equations.C, D.T + F],
                [on_x, on_v, None]]  # fmt: skip
    masses = [identity, identity, csc_array((len(chosen), len(chosen)))]
    if (own := equations.states) is not None:
        by_rows = own.position[chosen].multiply(position[:, None])
        by_rows = by_rows + own.velocity[chosen].multiply(~position[:, None])
        for row, block in zip(terms, (None, own.force, by_rows), strict=True):
            row.append(block)
        terms.append([own.by_displacement, own.by_velocity, None, own.by_states])
        masses.append(eye_array(own.by_states.shape[0]))
    B, E = block_array(terms).tocsc(), block_diag(masses).tocsc()
    largest = max(np.sqrt(_norm(equations.K)), _norm(equations.C), _norm(equations.S))
    sigma = SHIFT * largest if largest > 0.0 else 1.0
    factors = splu(csc_array(B - sigma * E))
    size = B.shape[0]
    operator = LinearOperator((size, size), lambda z: factors.solve(E @ np.asarray(z).ravel()))
    start = operator @ (operator @ np.random.default_rng(1).standard_normal(size))
    wanted = min(count, size - 2)
    try:
        theta, vectors = eigs(operator, k=wanted, v0=start, maxiter=100 * count, tol=1e-13)
    except ArpackNoConvergence as error:
        theta, vectors = error.eigenvalues, error.eigenvectors
        if len(theta) < wanted:
            raise SimulationError(
                f"of the lowest {wanted} eigenvalues {len(theta)} were found; take fewer modes"
            ) from error
    values = sigma + 1.0 / theta
    values[np.abs(values) < ZERO * sigma] = 0.0
    order = order_of(values)
    return Eigenvalues(values[order], vectors[:six, order])


def _norm(matrix: Any) -> float:
    """The largest sum of magnitudes in a row."""
    sums = np.asarray(abs(matrix).sum(axis=1))
    return float(np.max(sums, initial=0.0))
