"""The coordinates that a formulation integrates: those of bodies, or of its own."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.evaluate import place_bodies
from dap3d_core.formulations import ACCEPTED, FUNCTIONS, WATCH
from dap3d_core.kernels.runtime.cache import prepared
from dap3d_core.model.rotations import euler_rates, to_body, to_global
from dap3d_core.model.state_layout import COORDINATES, VELOCITIES, split


class UnsuitableError(ValueError):
    """A model does not suit a formulation; says why and what does."""


class Coordinates(ABC):
    """The integrated state y of a formulation, whose last component is the work.

    Attributes:
        evaluator: evaluates the model.
        size: components of y that steer the step: all but the work.
        length_count: lengths that ``project`` gives (formulations/common/constraints.py).
        are_of_bodies: y is that of bodies, as in model/state_layout.py.
        body_velocities: the part of y that is (6 n,) r_dot, w' of bodies; empty where none is.
        reference: arrays of what coordinates count from, which a run may move.
    """

    evaluator: Any
    size: int
    length_count: int
    are_of_bodies: bool
    body_velocities = slice(0, 0)
    reference: Sequence[Floats] = ()

    @abstractmethod
    def function(self, k: int) -> Any:
        """The compiled function of an index (``formulations.FUNCTIONS``)."""

    @property
    @abstractmethod
    def quantities(self) -> list[str]:
        """Quantity of each component, as in tolerances: "r", "p", "v", "w" or "z"."""

    @property
    @abstractmethod
    def bodies(self) -> Integers:
        """(size,) body that each component moves, from 0; -1 of states of elements."""

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """Name of each component but the work."""

    @abstractmethod
    def structure(self) -> tuple[str, str]:
        """Return the structure that solves the equations, and a description of its size."""

    @property
    def notes(self) -> list[str]:
        """Return notes on the choice of coordinates, for the results of runs."""
        return []

    @property
    def suits_batches(self) -> bool:
        """True if runs of other numbers of the model may share its arrays."""
        return True

    @abstractmethod
    def start(self, u: Floats) -> Floats:
        """The state y that a run from a state u (13 n,) begins with."""

    @abstractmethod
    def at(self, u: Floats) -> AbstractContextManager[Floats]:
        """The state y of a state u, for evaluations outside a run, which stays as it is."""

    @abstractmethod
    def body_states(self, y: Floats) -> Floats:
        """States (k, ...) in coordinates of bodies of states (k, size + 1)."""

    @abstractmethod
    def placer(self, y: Floats) -> Callable[[], object]:
        """A function that places the bodies of the state y, as it is then, in the system."""

    @abstractmethod
    def continued(self, expected: Floats, y: Floats) -> Floats:
        """The state y as the motion led to it, near the one expected; ``project`` may shift it."""

    @abstractmethod
    def with_jump(self, y: Floats, dv: Floats, states: Floats, work: float) -> Floats:
        """The state y after a jump.

        Args:
            y: the state before.
            dv: (6 n,) changes of r_dot and omega of each body, global axes.
            states: (states,) of elements then.
            work: of the impulses, J.
        """

    @abstractmethod
    def displace(self, y: Floats, moved: Floats) -> None:
        """Move the bodies of a state y by small r and rotation vectors (6 n,), global axes."""

    @abstractmethod
    def u_dot(self, t: float, u: Floats) -> Floats:
        """du/dt (13 n,), as of ``Evaluator.rhs``."""

    def report(self, t: float, u: Floats) -> Floats:
        """What the function ``report`` gives at a state u (13 n,)."""
        with self.at(u) as y:
            return self.evaluator.reported(t, y)

    def inertia_places(self, bodies: Integers) -> Integers:
        """Indices in numbers of its own of what masses and inertias of bodies, from 1, make."""
        return np.zeros(0, dtype=np.int64)

    def inertias(self, bodies: Integers, mass: Floats, Jp: Floats) -> Floats:
        """(k, ...) numbers for ``inertia_places`` of masses (k, b) and inertias (k, b, 3, 3)."""
        return np.zeros((len(mass), 0))


class BodyCoordinates(Coordinates):
    """The integrated state y of bodies, as in model/state_layout.py."""

    are_of_bodies = True

    def __init__(self, evaluator: Any) -> None:
        """Args: the evaluator whose states they are."""
        self.evaluator = evaluator
        layout = evaluator.model.integrated_layout
        self.size, self.body_velocities = layout.size - 1, layout["velocities"]
        self.length_count = len(evaluator.plan.nodes) - 1

    def function(self, k: int) -> Any:
        """As of ``Coordinates``; of contacts, the switches are those of their multipliers."""
        evaluator = self.evaluator
        has_contacts = evaluator.model.contact_count > 0
        name = "contacts.equations" if has_contacts else evaluator.method
        if k == ACCEPTED or (k == WATCH and not has_contacts):
            name = "common.switching_functions"
        return getattr(import_module(f"dap3d_core.formulations.{name}"), FUNCTIONS[k])

    @property
    def quantities(self) -> list[str]:
        """As of ``Coordinates``."""
        model = self.evaluator.model
        n = model.body_count
        return [*"rrrpppp"] * n + [*"vvvwww"] * n + ["z"] * model.state_count

    @property
    def bodies(self) -> Integers:
        """As of ``Coordinates``."""
        model = self.evaluator.model
        each, states = np.arange(model.body_count), np.full(model.state_count, -1)
        return np.concatenate([np.repeat(each, COORDINATES), np.repeat(each, VELOCITIES), states])

    @property
    def names(self) -> list[str]:
        """As of ``Coordinates``."""
        model, axes = self.evaluator.model, ("x", "y", "z")
        poses = [*(f"r.{a}" for a in axes), *(f"p.e{k}" for k in range(4))]
        rates = [*(f"rd.{a}" for a in axes), *(f"wp.{a}" for a in axes)]
        names = [f"{b}.{q}" for part in (poses, rates) for b in model.body_names for q in part]
        return [*names, *model.state_labels]

    def structure(self) -> tuple[str, str]:
        """As of ``Coordinates``."""
        plan = self.evaluator.plan
        ordering = plan.ordering
        return "matrix", (
            f"{len(ordering.early)} bodies eliminated first, then {len(ordering.nodes)} joint "
            f"nodes and {len(ordering.hubs)} hubs; {plan.fill} blocks of fill"
        )

    def start(self, u: Floats) -> Floats:
        """As of ``Coordinates``."""
        return self.evaluator.integrated(u)

    def body_states(self, y: Floats) -> Floats:
        """As of ``Coordinates``."""
        return y

    def placer(self, y: Floats) -> Callable[[], object]:
        """As of ``Coordinates``."""
        system = self.evaluator.system
        return prepared(place_bodies, y, system.body, system.metric)

    def continued(self, expected: Floats, y: Floats) -> Floats:
        """As of ``Coordinates``."""
        return y

    def with_jump(self, y: Floats, dv: Floats, states: Floats, work: float) -> Floats:
        """As of ``Coordinates``."""
        after = y.copy()
        parts = dv.reshape(-1, 2, 3)
        _, p, v, w = split(self.evaluator.bodies_of(after))
        v += parts[:, 0]
        w += to_body(p, parts[:, 1])
        after[self.evaluator.model.integrated_layout["states"]] = states
        after[-1] += work
        return after

    def displace(self, y: Floats, moved: Floats) -> None:
        """As of ``Coordinates``."""
        r, p, *_ = split(self.evaluator.bodies_of(y))
        parts = moved.reshape(-1, 2, 3)
        r += parts[:, 0]
        p += euler_rates(p, parts[:, 1])

    def u_dot(self, t: float, u: Floats) -> Floats:
        """As of ``Coordinates``."""
        evaluator = self.evaluator
        y = evaluator.integrated(u)
        u_dot: Floats = evaluator.bodies_of(evaluator.slope(t, y))
        w_dot = split(u_dot)[3]
        p = split(evaluator.bodies_of(y))[1]
        w_dot[:] = to_global(p, w_dot)  # omega_dot = A omega'_dot, no extra term
        return u_dot

    @contextmanager
    def at(self, u: Floats) -> Iterator[Floats]:
        """As of ``Coordinates``."""
        yield self.evaluator.integrated(u)
