"""The problem of one step: which impulses of its contacts keep bodies apart, with friction."""

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from dap3d_core.integrators.moreau.contact_set import ContactSet
from dap3d_core.integrators.moreau.gauss_seidel import sweep_bodies, sweep_contacts
from dap3d_core.integrators.moreau.newton import SMALL, TINY, Rows, distance, newton
from dap3d_core.kernels.array_types import Floats, Integers

#: Residual from which Newton's method begins, and sweeps of Gauss-Seidel that lead there.
NEAR, SWEEPS = 1e-4, 200
#: Over-relaxation of sweeps: piles of spheres took 1250 sweeps with 1, 720 with 1.5, and more than
#: 4000 with 1.7. It ends where a round of sweeps has not helped.
RELAX = 1.4
#: Sweeps at most, where Newton's method does not end.
MOST_SWEEPS = 2000
#: Rounds of sweeps and Newton's method, at most, where joints answer; parts of the largest below
#: which joints depend on each other, and of its own below which a contact cannot move.
ROUNDS, DEPENDENT, HELD = 3, 1e-12, 1e-12
#: Contacts up to which a problem is solved to rounding, whatever the tolerance.
FEW, RESIDUAL_ROUNDING = 100, 1e-14


class Problem:
    """Contacts of bodies, u = J v + bias, with joints held.

    Attributes:
        x: (m, 3) impulses, N s.
        y: (k,) those that joints answer with.
        residual: of the solution, a part of the largest impulse.
    """

    def __init__(self, contacts: ContactSet, inverse: Floats, masses: Floats, D: Floats) -> None:
        """Args:
        contacts: of the step.
        inverse, masses: (n + 1, 6, 6) M^-1 and M of each body; of ground zero and anything.
        D: (k, 6 n) rows of joints.
        """
        self._inverse, self._masses, self._D = inverse, masses, D
        self._bodies = np.ascontiguousarray(contacts.bodies)
        i, j = self._bodies.T
        J = contacts.J
        moved = np.concatenate([J[:, :, :6] @ inverse[i], J[:, :, 6:] @ inverse[j]], axis=2)
        self._J, self._MJ = (np.ascontiguousarray(x.reshape(-1, 36)) for x in (J, moved))
        self._W = np.ascontiguousarray((moved @ J.transpose(0, 2, 1)).reshape(-1, 9))
        diagonal = self._W[:, ::4].max(axis=1)
        self._r = 1.0 / np.maximum(diagonal, TINY)
        self.x: Floats = np.zeros((len(J), 3))
        self.y: Floats = np.zeros(len(D))
        self.residual = 0.0

    def velocity(self, v: Floats) -> Floats:
        """(m, 3) normal and tangential velocities of velocities (n + 1, 6)."""
        i, j = self._bodies.T
        both = np.concatenate([v[i], v[j]], axis=1)
        found: Floats = np.einsum("mrk,mk->mr", self._J.reshape(-1, 3, 12), both)
        return found

    def work_of_joints(self, v: Floats) -> float:
        """Work of the joints' impulses on bodies of velocities (n + 1, 6), J: that of drivers."""
        return float(self.y @ (self._D @ v[1:].ravel()))

    def change(self) -> Floats:
        """(n + 1, 6) changes of velocity by the impulses."""
        found = np.zeros(self._inverse.shape[:2])
        parts = np.einsum("mr,mrk->mk", self.x, self._MJ.reshape(-1, 3, 12))
        for side in range(2):
            for k in range(6):
                part = parts[:, 6 * side + k]
                found[:, k] += np.bincount(self._bodies[:, side], part, len(found))
        found[0] = 0.0
        if len(self.y):
            pull = (self.y @ self._D).reshape(-1, 6, 1)
            found[1:] += (self._inverse[1:] @ pull)[:, :, 0]
        return found

    def solve(self, v: Floats, bias: Floats, mu: Floats, start: Floats, tolerance: float) -> Floats:
        """Velocities (n + 1, 6) with the impulses that solve the problem.

        Args:
            v: (n + 1, 6) velocities without impulses, ground first, which fit the joints.
            bias: (m,) m/s, added to normal velocities, which are not to become negative then.
            mu: (m,).
            start: (m, 3) impulses that are tried first.
            tolerance: of the residual.
        """
        self._free, self._bias, self._mu = v, bias, mu
        self.x = start.copy()
        few = len(mu) <= FEW
        if few or len(self.y):
            to_rounding = few and tolerance < NEAR
            aim = RESIDUAL_ROUNDING if to_rounding else tolerance
            self._refine(np.arange(len(mu)), aim)
            if few and len(self.y) and self.residual > tolerance:
                self._refine_held(tolerance, aim)
            if self._judge() <= tolerance or len(self.y):
                return v + self.change()
        if self._judge() > tolerance:
            self._sweep(SWEEPS, max(tolerance, NEAR), RELAX)
            self._finish(tolerance)
        return v + self.change()

    def _judge(self) -> float:
        left = self._left()
        self.residual = float(left.max()) if len(left) else 0.0
        return self.residual

    def _left(self) -> Floats:
        """(m,) residual of each contact, a part of the largest impulse."""
        u = self.velocity(self._free + self.change())
        u[:, 0] += self._bias
        left = np.abs(distance(self.x, u, self._mu, self._r)).max(axis=1)
        found: Floats = left / (np.abs(self.x).max() + TINY)
        return found

    def _sweep(self, sweeps: int, tolerance: float, relax: float) -> None:
        state = np.ascontiguousarray(self._free + self.change())
        sweep_bodies(self._bodies, self._J, self._MJ, self._W, self._bias, self._mu,
                     self.x, state, sweeps, 0.1 * tolerance, relax)  # fmt: skip

    def _finish(self, tolerance: float) -> None:
        """Newton's method on groups that are not solved; more sweeps where it does not end."""
        done, sweeps, relax, least = SWEEPS, SWEEPS, RELAX, np.inf
        while self._judge() > tolerance:
            relax = relax if self.residual < least else 1.0
            least = min(least, self.residual)
            if tolerance < NEAR:
                for group in self._groups(tolerance):
                    self._refine(group, tolerance)
            if self._judge() <= tolerance or done >= MOST_SWEEPS:
                return
            if tolerance < NEAR:  # rounds of Newton's method cost more
                sweeps = done
            self._sweep(sweeps, tolerance, relax)
            done += sweeps

    def _refine(self, group: Integers, tolerance: float) -> None:
        """Newton's method on one group of contacts."""
        rows = self._rows(group)
        before = rows.residual(self.x[group], self.y)
        x, y, left = newton(rows, self.x[group], self.y, tolerance)
        if left < before:
            self.x[group], self.y = x, y
        self.residual = left

    def _refine_held(self, tolerance: float, aim: float) -> None:
        """Sweeps that count in what joints answer with, then Newton's method, where it stalled.

        Held between bodies that joints guide, impulses are not unique, and Newton's method has no
        way from far away: sweeps have one.
        """
        rows = self._rows(np.arange(len(self.x)))
        inverse, J, D = (part if isinstance(part, np.ndarray) else part.toarray()
                         for part in (rows.inverse, rows.J, rows.D))  # fmt: skip
        moved, turned = inverse @ J.T, inverse @ D.T
        answer = np.linalg.pinv(D @ turned, rcond=DEPENDENT, hermitian=True) @ (D @ moved)
        felt = J @ moved - (J @ turned) @ answer
        own = np.array([felt[k : k + 3, k : k + 3] for k in range(0, len(felt), 3)]).reshape(-1, 9)
        own[own[:, 0] * self._r < HELD] = 0.0
        for _ in range(ROUNDS):
            x = self.x.copy()
            u = (rows.J @ rows.free + rows.b + felt @ x.ravel()).reshape(-1, 3)
            sweep_contacts(felt, own, u, self._mu, x, SWEEPS, aim)
            x, y, left = newton(rows, x, -answer @ x.ravel(), aim)
            if left < self.residual:
                self.x, self.y, self.residual = x, y, left
            if self.residual <= tolerance:
                return

    def _rows(self, group: Integers) -> Rows:
        """The equations of a group of contacts."""
        n = len(self._inverse)
        used = np.unique(self._bodies[group]) if not len(self.y) else np.arange(n)
        used = used[used > 0]
        place = np.zeros(n, dtype=np.int64)
        place[used] = 1 + np.arange(len(used))
        b = np.zeros((len(group), 3))
        b[:, 0] = self._bias[group]
        D = self._D if len(self.y) else np.zeros((0, 6 * len(used)))
        s = 1.0 / np.maximum(self._feel(D), TINY)
        J = self._J[group].reshape(-1, 3, 2, 6)
        parts = _matrices(place[self._bodies[group]], J, self._masses[used], self._inverse[used], D)
        return Rows(*parts, b.ravel(), self._free[used].ravel(), self._mu[group], self._r[group], s)

    def _feel(self, D: Floats) -> Floats:
        """(k,) diagonal of D M^-1 D^T."""
        if not len(D):
            return np.zeros(0)
        blocks = D.reshape(len(D), -1, 6)
        found: Floats = np.einsum("kbi,bij,kbj->k", blocks, self._inverse[1:], blocks)
        return found

    def _groups(self, tolerance: float) -> Iterator[Integers]:
        """Contacts that feel each other, where one of them is not solved."""
        left, labels = self._left(), self.groups
        for label in np.unique(labels[left > tolerance]):
            yield np.flatnonzero(labels == label)

    @cached_property
    def groups(self) -> Integers:
        """(m,) number of the group of bodies that each contact belongs to."""
        import scipy.sparse as sp
        from scipy.sparse.csgraph import connected_components

        if len(self.y):
            return np.zeros(len(self.x), dtype=np.int64)
        i, j = self._bodies.T
        inner = (i > 0) & (j > 0)
        count = len(self._inverse)
        graph = sp.coo_array((np.ones(inner.sum()), (i[inner], j[inner])), shape=(count, count))
        labels: Integers = connected_components(graph, directed=False)[1]
        found: Integers = labels[np.where(i > 0, i, j)]
        return found


def _matrices(
    place: Integers, J: Floats, M: Floats, inverse: Floats, D: Floats
) -> tuple[Any, Any, Any, Any]:
    """M, M^-1, J and D; J (m, 3, 2, 6) of bodies at ``place`` (m, 2), ground 0."""
    n, m = len(M), len(J)
    if 6 * n <= SMALL:
        which, both = np.arange(n), np.zeros((2, n, 6, n, 6))
        both[:, which, :, which] = np.stack([M, inverse], axis=1)
        full = np.zeros((m, 3, n + 1, 6))
        for side in range(2):
            full[np.arange(m), :, place[:, side]] += J[:, :, side]
        return *both.reshape(2, 6 * n, 6 * n), full[:, :, 1:].reshape(3 * m, 6 * n), D
    import scipy.sparse as sp

    row = np.broadcast_to(np.arange(3 * m).reshape(m, 3, 1, 1), J.shape)
    column = np.broadcast_to((6 * place - 6)[:, None, :, None] + np.arange(6), J.shape)
    real = column >= 0
    rows = sp.csr_array((J[real], (row[real], column[real])), shape=(3 * m, 6 * n))
    each = np.arange(n), np.arange(n + 1)
    wide = [sp.bsr_array((blocks, *each), shape=(6 * n, 6 * n)).tocsr() for blocks in (M, inverse)]
    return *wide, rows, sp.csr_array(D)
