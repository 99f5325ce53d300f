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

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.jumps import jump_arrays
from dap3d_core.formulations.jumps.held_joints import held_functions
from dap3d_core.formulations.jumps.rounds import jump

#: Rounds of one instant.
ROUNDS = 1000


class ImpossibleJumpError(ValueError):
    """Joints hold what a row is to change; names its element, "" for a row of none."""


@attrs.frozen(eq=False)
class Jump:
    """The jump of the velocities at one instant.

    Attributes:
        y: the state after it, in coordinates of bodies.
        dv: (6 n,) change of r_dot and omega of each body, global axes.
        work: done by all impulses, J; exchanged: sum of the magnitudes of its parts, J.
        elements: names of those whose impulses are not zero, in the order of the model.
        states: (states,) of elements then.
        sides: (switches,) on which side each switch is then.
        rounds: how many it took.
    """

    y: Floats
    dv: Floats
    work: float
    exchanged: float
    states: Floats
    elements: tuple[str, ...]
    sides: Floats
    rounds: int


class JumpLaw:
    """Finds the jumps of one model; its evaluator is not in use meanwhile.

    Attributes:
        elements: of the model.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        self._evaluator = in_bodies = evaluator
        self.elements = jump_arrays.JumpElements(evaluator)
        if not evaluator.coordinates.are_of_bodies:  # they have no factors
            in_bodies = Evaluator(evaluator.model, "lsq")
        self._held = in_bodies
        has_rows, redundant = evaluator.model.row_count > 0, in_bodies.formulation.accepts_redundant
        self._functions = held_functions(has_rows, redundant)

    @cached_property
    def arrays(self) -> jump_arrays.JumpArrays:
        """What the law works on where no rows are given."""
        return self.elements.arrays(self._evaluator, self._held, 0, ROUNDS)

    def arguments(self, arrays: jump_arrays.JumpArrays) -> tuple[Any, ...]:
        """Arguments of the compiled law behind the time."""
        one, held = self._evaluator, self._held
        return arrays, one.system, one.loops, self._functions, held.system, held.loops

    @IGNORE_FLOAT_ERRORS
    def jump(
        self,
        t: float,
        y: Floats,
        sides: Floats | None,
        crossing: Floats,
        soon: float,
        given: Sequence[tuple[Floats, float]] | None = None,
    ) -> Jump:
        """The jump at time t and state y; the evaluator then holds the states of elements after it.

        Args:
            t, y: time and state before it, in coordinates of bodies.
            sides: (switches,) +1 or -1, the side that each switch is on; 0: none; where it is None
                they are those of the state.
            crossing: (switches,) the same of those that have just come there, else 0.
            soon: s, what closes within it is closed.
            given: rows (6 n + 6,) of the first round besides those of elements, ground first, and
                their changes; where it is not None velocities follow the joints with states that
                have been set.

        Raises:
            ImpossibleJumpError: joints hold what a row is to change.
        """
        evaluator, names = self._evaluator, self.elements.names
        j = self.arrays
        if given:
            j = self.elements.arrays(evaluator, self._held, len(given), ROUNDS)
            j.given[:] = [np.append(row, change) for row, change in given]
        j.given_count, j.follows = len(given or ()), int(given is not None)
        j.soon, j.has_sides = soon, int(sides is not None)
        j.y[:] = y
        j.switches[jump_arrays.SIDE] = 0.0 if sides is None else sides
        j.switches[jump_arrays.CROSSING] = crossing
        self._held.set_inputs(evaluator.inputs)
        jump(float(t), *self.arguments(j))
        if j.missed != -1:
            raise ImpossibleJumpError(names[j.missed] if j.missed >= 0 else "")
        evaluator.states = states = j.y[evaluator.model.integrated_layout["states"]].copy()
        acted = [names[k] for k in np.flatnonzero(j.acting).tolist()]
        dv = j.v[jump_arrays.NOW] - j.v[jump_arrays.BEFORE]
        return Jump(
            j.y.copy(), dv, j.work, j.exchanged, states, tuple(dict.fromkeys(acted)),
            j.switches[jump_arrays.SIDE].copy(), j.rounds,
        )  # fmt: skip
