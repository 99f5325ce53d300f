"""The law of jumps: all elements at one instant, in rounds, with the joints held.

In a round all elements give the change of their rows' rates, or their impulses, for the velocities
that the round begins with, and all are met at once:

    M dv - D^T Lambda_D - G^T Lambda = P,    D dv = nu - D v,    G dv = change,    Lambda >= 0

where they push (docs/how-to/jumps.md). Then elements reset their states, and where that moves the
right-hand side nu of a joint, velocities follow. What touches and approaches after that answers in
the next round, until nothing does: so impacts travel through bodies that touch, as through Newton's
cradle. Rounds without end become smaller and smaller; after ROUNDS what still approaches is
stopped.
"""

from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.jumps.elements import JumpElements, JumpRows, no_rows
from dap3d_core.formulations.jumps.held_joints import HeldJoints
from dap3d_core.formulations.jumps.multipliers import missed_rows, row_impulses
from dap3d_core.model.state_layout import velocities_of

#: Rounds of one instant.
ROUNDS = 1000
#: A change of a rate is rounding below this part of what the velocities of its bodies make of it.
RATE_ROUNDING = 1e-13


class ImpossibleJumpError(ValueError):
    """Joints hold what a row is to change; names its element, "" for a row of none."""


@attrs.frozen(eq=False)
class Jump:
    """The jump of the velocities at one instant.

    Attributes:
        dv: (6 n,) change of r_dot and omega of each body, global axes.
        work: done by all impulses, J; exchanged: sum of the magnitudes of its parts, J.
        elements: names of those whose impulses are not zero, in the order of the model.
        states: (states,) of elements then.
        sides: (switches,) on which side each switch is then.
        rounds: how many it took.
    """

    dv: Floats
    work: float
    exchanged: float
    states: Floats
    elements: tuple[str, ...]
    sides: Floats
    rounds: int


class JumpLaw:
    """Finds the jumps of one model; its evaluator is not in use meanwhile."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        self._evaluator = in_bodies = evaluator
        self.elements = JumpElements(evaluator)
        if evaluator.formulation.has_own_coordinates:  # it has no factors
            in_bodies = Evaluator(evaluator.model, "lsq")
        self._held = HeldJoints(in_bodies)

    def jump(
        self,
        t: float,
        u: Floats,
        sides: Floats | None,
        crossing: Floats,
        soon: float,
        given: JumpRows | None = None,
    ) -> Jump:
        """The jump at time t and state u (13 n,), which the evaluator holds with its states.

        Args:
            t, u: time and state before it.
            sides: (switches,) +1 or -1, the side that each switch is on; 0: none; where it is None
                they are those of the state.
            crossing: (switches,) the same of those that have just come there, else 0.
            soon: s, what closes within it is closed.
            given: rows of the first round besides those of elements, of no element (-1); where it
                is not None velocities follow the joints with states that have been set.

        Raises:
            ImpossibleJumpError: joints hold what a row is to change.
        """
        elements, evaluator = self.elements, self._evaluator
        one = _Rounds(self._held, t, u, evaluator.states, evaluator.inputs)
        values = elements.switch_values(t, u)
        sides = np.sign(values) if sides is None else sides.copy()
        while one.count < ROUNDS:
            closed = (values <= 0.0) | (sides == 0.0)
            P, acting, rows = elements.impulses(t, one.state, values, crossing, closed, soon)
            rows = one.beyond_rounding(rows)
            asks = bool(len(acting) or len(rows.change))
            if given is not None and one.count == 0:
                rows, asks = rows + given, True
            moves = asks and one.meet(P, rows, elements.names)
            one.acting.update(acting.tolist())
            states, resetting = elements.resets(t, one.state, crossing)
            if len(resetting):
                one.acting.update(resetting.tolist())
                evaluator.states = states
                moves |= one.reset(states, elements.names)
            values = elements.switch_values(t, one.state)
            crossing = np.where(elements.is_jump & (values * sides < 0.0), np.sign(values), 0.0)
            sides = np.where(crossing != 0.0, crossing, sides)
            if not (moves or crossing.any()):
                break
        else:
            one.stop(elements.names)
        names = tuple(dict.fromkeys(elements.names[k] for k in sorted(one.acting - {-1})))
        dv = one.v - velocities_of(u)
        return Jump(dv, one.work, one.exchanged, evaluator.states, names, sides, one.count)


class _Rounds:
    """Velocities in the course of one jump."""

    def __init__(
        self, held: HeldJoints, t: float, u: Floats, states: Floats, inputs: Floats
    ) -> None:
        self.held, self.state, self._t, self._inputs = held, u.copy(), t, inputs
        self.v = velocities_of(u).copy()
        self.fastest = np.abs(self.v)
        self.work, self.exchanged, self.count = 0.0, 0.0, 0
        self.acting: set[int] = set()
        self._touched: dict[tuple[int, int], Floats] = {}  # rows that push, by element and row
        held.set_state(t, u, states, inputs)
        self._residual = held.residual  # of the joints: the first round takes it away

    def beyond_rounding(self, rows: JumpRows) -> JumpRows:
        """The rows with a change that is no rounding of the velocities of their bodies."""
        size = np.abs(rows.G[:, 6:]) @ self.fastest
        return _some(rows, np.abs(rows.change) > RATE_ROUNDING * size)

    def meet(self, P: Floats, rows: JumpRows, names: list[str]) -> bool:
        """Let impulses P (6 n + 6,) act, and the rows change their rates as they ask for.

        Returns False where no velocity changes.
        """
        held, before = self.held, self.v
        base, of_held = held.solve(held.scaled(P), -self._residual)
        G = held.scaled(rows.G)
        length = np.linalg.norm(G, axis=1)  # rows of unit length; their impulses are scaled, too
        length[length == 0.0] = 1.0
        G = G / length[:, None]
        unit = [held.solve(g, np.zeros(len(self._residual))) for g in G]
        dv, Lam = base, np.zeros(len(G))
        if unit:
            x = np.array([dv_of_row for dv_of_row, _ in unit])
            A, b = G @ x.T, rows.change / length - G @ base
            A = 0.5 * (A + A.T)
            Lam = row_impulses(A, b, rows.pushes)
            missed = missed_rows(A, b, Lam, rows.pushes)
            if len(missed):
                element = int(rows.element[missed[0]])
                raise ImpossibleJumpError(names[element] if element >= 0 else "")
            dv = base + Lam @ x
            of_held = of_held + Lam @ np.array([of_row for _, of_row in unit])
        self.v = before + held.unscaled(dv)[6:]
        mean = 0.5 * (before + self.v)
        Lam = Lam / length
        of_rows, of_joints = Lam * (rows.G[:, 6:] @ mean), held.nu + 0.5 * self._residual
        self.work += float(P[6:] @ mean + np.sum(of_rows) + of_held @ of_joints)
        speeds = np.abs(rows.G[:, 6:] @ before) + np.abs(rows.G[:, 6:] @ self.v)
        self.exchanged += float(0.5 * np.abs(Lam) @ speeds + np.abs(P[6:]) @ np.abs(mean))
        self._residual = np.zeros_like(self._residual)
        self.fastest = np.maximum(self.fastest, np.abs(self.v))
        velocities_of(self.state)[:] = self.v
        self.acting.update(rows.element[Lam != 0.0].tolist())
        for k in np.flatnonzero(rows.pushes):
            self._touched[int(rows.element[k]), int(rows.row[k])] = rows.G[k]
        self.count += 1
        return bool(dv.any())

    def reset(self, states: Floats, names: list[str]) -> bool:
        """Let velocities follow the joints with other states of elements; whether they do."""
        self.held.set_state(self._t, self.state, states, self._inputs)
        self._residual = self.held.residual
        return self.meet(np.zeros(self.held.size), no_rows(self.held.size), names)

    def stop(self, names: list[str]) -> None:
        """Stop what still approaches, of all rows that push and have answered."""
        if not self._touched:
            return
        element, row = np.array(list(self._touched), dtype=np.int64).T
        G = np.array(list(self._touched.values()))
        pushes = np.ones(len(G), dtype=bool)
        self.meet(
            np.zeros(G.shape[1]), JumpRows(G, -G[:, 6:] @ self.v, pushes, element, row), names
        )


def _some(rows: JumpRows, which: Any) -> JumpRows:
    """Some of the rows."""
    return JumpRows(*(column[which] for column in attrs.astuple(rows, recurse=False)))
