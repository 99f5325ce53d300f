"""Statics of a constrained system at one pose: balance of forces and stiffness of its freedoms.

With forces F, rows D and multipliers lambda the residual of the balance is F + D^T lambda, force
and moment about the mass centre of each body. Unknowns are displacements x = (dr / L, dtheta) of
all bodies, with L a length of the scene; the null space Z of the scaled rows, by singular values,
are the freedoms, so that redundant rows and singular poses need nothing of their own. Rows of the
velocity level alone constrain displacements as they do velocities. All is at rest, at one time.
"""

from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import WRENCH
from dap3d_core.formulations.common.state_derivatives import StateDerivatives, state_derivatives
from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.function_lists import call_loop
from dap3d_core.linear.rank import tolerance_of
from dap3d_core.model.element_states import first_states, paths_where, width_of
from dap3d_core.simulation.errors import AssemblyError, SimulationError
from dap3d_core.simulation.initial.assemble import fit_of, weights_of
from dap3d_core.simulation.initial.least_change import (
    displaced,
    displacement,
    finite_rows,
    sparse_least_change,
)
from dap3d_core.simulation.linearization.tangent import TangentMatrices, tangent_matrices

#: Displacements of bodies, rad or parts of the scene, that show how large forces are.
NEARBY = 1e-3
#: Passes that close the position rows.
MOST_PASSES = 25


#: Newton steps at most; rates below this part of their terms are zero.
MOST_STEPS, SETTLED = 50, 1e-11
#: Singular values below this part of the largest leave a state open.
OPEN = 1e-10
#: Displacements of bodies, rad or parts of the scene, below which a state that keeps the way of a
#: motion stays.
STAYED = 1e-6


@attrs.frozen(eq=False)
class StaticPose:
    """Balance of forces at a pose. Scaled: displacements (dr / L, dtheta), forces in N m.

    Attributes:
        u: (13 n,) the state, without velocities.
        force: (6 n,) scaled applied forces.
        rows: the constraint rows, scaled.
        gradient: (rows,) from a scaled row to a row of the model.
        free: (6 n, f) Z, an orthonormal basis of the freedoms.
        multipliers: (rows,) of the scaled rows, of least norm.
        unbalanced: (f,) Z^T F, what no reaction carries.
        size: of forces and reactions, N m: what rounding errors are a part of.
    """

    u: Floats
    force: Floats
    rows: ConstraintRows
    gradient: Floats
    free: Floats
    multipliers: Floats
    unbalanced: Floats
    size: float

    @property
    def residual(self) -> float:
        """Length of what is unbalanced, as a part of ``size``."""
        length = float(np.linalg.norm(self.unbalanced))
        return length / self.size if length else 0.0


class Statics:
    """Evaluates the balance of forces of a model at rest.

    Attributes:
        evaluator: the evaluator. Angles count their turns from the pose that it saw last.
        t: the time, s.
        length: L, m.
        settles: states of elements follow the pose; False to hold them.
    """

    def __init__(self, evaluator: Evaluator, t: float = 0.0) -> None:
        self.evaluator, self.t = evaluator, t
        self._size_nearby = 0.0
        self.settles = True
        self.length = evaluator.model.part_size
        n = evaluator.model.body_count
        self.scale = np.tile(np.repeat([self.length, 1.0], 3), n)

    def at(self, u: Floats) -> StaticPose:
        """Balance of forces at a state (13 n,).

        Raises:
            AssemblyError: a row is not finite there.
        """
        if not self._size_nearby:
            self._size_nearby = self._largest_nearby(u)
        rows, gradient = scaled_rows(finite_rows(self.evaluator, self.t, u), self.length)
        force = self.force(u)
        D = rows.dense()
        left, values, right = np.linalg.svd(D, full_matrices=True)
        zero = max(
            tolerance_of(*D.shape) * np.max(values, initial=0.0), fit_of(self.evaluator.model)
        )
        rank = int(np.sum(values > zero))
        free = right[rank:].T
        multipliers = -left[:, :rank] @ ((right[:rank] @ force) / values[:rank])
        reaction = np.bincount(
            rows.column, np.abs(rows.value * multipliers[rows.row]), minlength=len(force)
        )
        size = float(np.max(self._force_parts(u) + reaction, initial=self._size_nearby))
        return StaticPose(u, force, rows, gradient, free, multipliers, free.T @ force, size)

    def force(self, u: Floats) -> Floats:
        """(6 n,) scaled applied forces at a state, those of elements with their states settled."""
        self._settle(u)
        return self.scale * self.evaluator.applied_forces(self.t, u).ravel()

    def _force_parts(self, u: Floats) -> Floats:
        """(6 n,) scaled forces added up by their magnitudes, type by type."""
        s, loops = self.evaluator.system, self.evaluator.loops
        self._settle(u)
        self.evaluator.place(self.t, u)
        parts = np.zeros(len(self.scale) + 6)
        for q in range(s.kinds[WRENCH], s.kinds[WRENCH + 1]):
            of_type = np.zeros_like(parts)
            call_loop(loops, q, self.t, s, s.groups[q], of_type, of_type, of_type)
            parts += np.abs(of_type)
        return self.scale * parts[6:]

    def _largest_nearby(self, u: Floats) -> float:
        """The largest force near a pose, N m: at the pose springs may hold each other."""
        rng = np.random.default_rng(1)
        largest = 0.0
        for _ in range(3):
            x = np.asarray(NEARBY * rng.standard_normal(len(self.scale)), dtype=np.float64)
            largest = max(largest, float(np.max(self._force_parts(self.moved(u, x)))))
        return largest

    def balance(self, u: Floats, pose: StaticPose) -> Floats:
        """(6 n,) scaled F + D^T lambda at a state, with the multipliers of a pose."""
        rows = self.evaluator.rows(self.t, u)
        share = rows.value * (pose.multipliers / pose.gradient)[rows.row]
        reaction = np.bincount(rows.column, share, minlength=len(self.scale))
        return self.force(u) + self.scale * reaction

    def stiffness(self, pose: StaticPose) -> Floats:
        """(f, f) Z^T K Z with K = -d(F + D^T lambda)/dx, the stiffness of reactions included.

        States that keep the way of a motion stay as they are, as they do in ``force``. Errors as of
        ``fixed_tangent``.
        """
        tangent = with_settled(self.fixed_tangent(pose), self.evaluator, keeps_way=False)
        return self.reduced(tangent.stiffness, pose)

    def tangent(self, pose: StaticPose) -> TangentMatrices:
        """The equations of motion and their derivatives at a pose, at rest, states settled."""
        return with_settled(self.fixed_tangent(pose), self.evaluator)

    def _settle(self, u: Floats) -> None:
        """Let the states of elements come to rest at a pose."""
        if self.evaluator.model.state_count and self.settles:
            settle(self.evaluator, self.t, u)

    def fixed_tangent(self, pose: StaticPose) -> TangentMatrices:
        """The same with the states of elements held.

        Raises:
            SimulationError: forces or rows have no derivative there.
        """
        multipliers = pose.multipliers / pose.gradient
        rest = np.zeros(len(self.scale))
        return tangent_matrices(self.evaluator, self.t, pose.u, multipliers, rest)

    def reduced(self, matrix: Any, pose: StaticPose) -> Floats:
        """(f, f) Z^T A Z of a matrix A (6 n, 6 n), scaled."""
        basis = self.scale[:, None] * pose.free
        return basis.T @ (matrix @ basis)

    def way(self, u: Floats, other: Floats) -> Floats:
        """(6 n,) the displacement from a state to another."""
        shift, turn = displacement(u, other)
        return np.hstack([shift / self.length, turn]).ravel()

    def behind(self, u: Floats, x: Floats) -> StaticPose:
        """The pose behind a displacement x (6 n,), closed; errors as of ``closed`` and ``at``."""
        return self.at(self.closed(self.moved(u, x)))

    def moved(self, u: Floats, x: Floats) -> Floats:
        """The state after a displacement x (6 n,), not closed."""
        return displaced(u, self.scale * x)

    def closed(self, u: Floats) -> Floats:
        """The state with its position rows closed to rounding, by least displacements.

        Raises:
            AssemblyError: they do not close.
        """
        if not self.evaluator.model.row_count:
            return u
        weight, before = weights_of(self.evaluator), np.inf
        limit = fit_of(self.evaluator.model) * self.evaluator.model.length
        best = u
        for _ in range(MOST_PASSES):
            C = finite_rows(self.evaluator, self.t, u).C
            worst = float(np.max(np.abs(weight * C), initial=0.0))
            if not worst < before:
                break
            best, before = u, worst
            if worst == 0.0:
                break
            u = displaced(u, -sparse_least_change(self.evaluator, C, self.t))
        if not before <= limit:
            raise AssemblyError(f"the positions do not close: |C| = {before:.2g}")
        return best


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


def moving_states(evaluator: Evaluator, u: Floats) -> str:
    """Names of the states that do not come to rest at a pose; "" where all do."""
    own = _derivatives(evaluator, 0.0, u)
    moves = np.abs(own.rates) > 1e3 * SETTLED * _terms(own, evaluator.states)
    return ", ".join(paths_where(evaluator.model.element_states, moves))


def refuse_carried(evaluator: Evaluator, u: Floats, other: Floats) -> None:
    """Refuse a motion from a state u to another that changes what no pose decides.

    Raises:
        SimulationError: rates of states vanish at rest whatever they are, as of elongations of
            belts and deflections of bristles, and the motion would have changed them; or a joint
            drives by its states, as of a motor that is on the way to its position.
    """
    displaced_by = np.hstack(displacement(u, other)).ravel()
    size = np.tile(np.repeat([evaluator.model.part_size, 1.0], 3), evaluator.model.body_count)
    moves = np.zeros(evaluator.model.state_count, bool)
    for pose in (u, other):
        own = _derivatives(evaluator, 0.0, pose)
        by_motion = _kept_way(own, _inverse(evaluator, own.rate_by_states))
        change = np.abs(by_motion @ displaced_by)
        moves |= change > STAYED * (abs(by_motion) @ size)
    driven = np.asarray(abs(own.velocity_by_states).sum(axis=1)).ravel() > 0.0
    speeds = evaluator.rows(0.0, other).nu
    if underway := evaluator.model.row_owners(np.flatnonzero(driven & (np.abs(speeds) > STAYED))):
        raise SimulationError(
            f"no equilibrium: {', '.join(underway)} moves bodies to another position. Let the "
            "motion come to rest (simulate), and start at its end (start=result)"
        )
    if carried := paths_where(evaluator.model.element_states, moves):
        raise SimulationError(
            f"statics does not know {', '.join(carried)} where forces balance: no pose decides "
            "such a state, it keeps the way of the motion there. Let a damped motion come to rest "
            "(simulate)"
        )


def _kept_way(own: StateDerivatives, inverse: Any) -> Any:
    """(s, 6 n) changes of the states by displacements, where rates at rest leave them open."""
    by_motion = own.rate_by_velocity
    return by_motion - own.rate_by_states @ (inverse @ by_motion)


def with_settled(
    tangent: "TangentMatrices", evaluator: Evaluator, *, keeps_way: bool = True
) -> "TangentMatrices":
    """A tangent with the stiffness of states: settled, and such that keep the way of a motion."""
    own = tangent.states
    if own is None:
        return tangent
    inverse = _inverse(evaluator, own.rate_by_states)
    follows = inverse @ own.rate_by_displacement
    if keeps_way:
        follows = follows - _kept_way(own, inverse)
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
