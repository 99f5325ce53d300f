"""The coordinates that a formulation integrates: those of bodies, or of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.model.rotations import to_body
from dap3d_core.model.state_layout import COORDINATES, VELOCITIES, split

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator


class UnsuitableError(ValueError):
    """A model does not suit a formulation; says why and what does."""


class Coordinates:
    """The integrated state y of bodies, as in model/state_layout.py.

    Attributes:
        size: components of y that steer the step: all but the work.
        length_count: lengths that ``project`` gives (formulations/common/constraints.py).
    """

    def __init__(self, evaluator: "Evaluator") -> None:
        """Args: the evaluator whose states they are."""
        self.evaluator = evaluator
        self.size = evaluator.model.integrated_layout.size - 1
        self.length_count = len(evaluator.plan.nodes) - 1

    @property
    def quantities(self) -> list[str]:
        """Quantity of each component, as in tolerances: "r", "p", "v", "w" or "z"."""
        model = self.evaluator.model
        n = model.body_count
        return [*"rrrpppp"] * n + [*"vvvwww"] * n + ["z"] * model.state_count

    @property
    def bodies(self) -> Integers:
        """(size,) body of each component, from 0; -1 of states of elements."""
        model = self.evaluator.model
        each, states = np.arange(model.body_count), np.full(model.state_count, -1)
        return np.concatenate([np.repeat(each, COORDINATES), np.repeat(each, VELOCITIES), states])

    def structure(self) -> tuple[str, str]:
        """Return the structure that solves the equations, and a description of its size."""
        plan = self.evaluator.plan
        ordering = plan.ordering
        return "matrix", (
            f"{len(ordering.early)} bodies eliminated first, then {len(ordering.nodes)} joint "
            f"nodes and {len(ordering.hubs)} hubs; {plan.fill} blocks of fill"
        )

    @property
    def notes(self) -> list[str]:
        """Return notes on the choice of coordinates, for the results of runs."""
        return []

    def start(self, u: Floats) -> Floats:
        """The state y that a run from a state u (13 n,) begins with."""
        return self.evaluator.integrated(u)

    def body_states(self, y: Floats) -> Floats:
        """The same states (k, size + 1) in coordinates of bodies."""
        return y

    def continued(self, expected: Floats, y: Floats) -> Floats:
        """The state y as the motion led to it, near the one expected; ``project`` may shift it."""
        return y

    def with_jump(self, y: Floats, dv: Floats, states: Floats, work: float) -> Floats:
        """The state y after a jump.

        Args:
            y: the state before.
            dv: (6 n,) changes of r_dot and omega of each body, global axes.
            states: (states,) of elements then.
            work: of the impulses, J.
        """
        after = y.copy()
        parts = dv.reshape(-1, 2, 3)
        _, p, v, w = split(self.evaluator.bodies_of(after))
        v += parts[:, 0]
        w += to_body(p, parts[:, 1])
        after[self.evaluator.model.integrated_layout["states"]] = states
        after[-1] += work
        return after

    @contextmanager
    def at(self, u: Floats) -> Iterator[Floats]:
        """The state y of a state u, for evaluations outside a run."""
        yield self.evaluator.integrated(u)
