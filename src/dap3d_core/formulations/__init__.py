"""Formulations: accelerations and multipliers from a state.

A formulation is a module of this package with the compiled functions ``rhs``, ``project`` and
``report`` (standard.py says what each does), and an entry of ``FORMULATIONS``.
"""

from importlib import import_module
from typing import Any

import attrs

#: Indices of a formulation's functions in the list that an integrator takes, and their names.
FUNCTIONS = ("rhs", "project", "report", "accepted", "watch")
RHS, PROJECT, REPORT, ACCEPTED, WATCH = range(5)
#: What a projection gives besides lengths (integrators/runge_kutta/step.py).
OUTCOMES = 4

#: Kinds of group loops that every formulation calls, and those of joints.
_ALL = ("value", "wrench", "energy", "angle", "turned", "switch", "bound", "knot", "rate",
        "impulse", "reset")  # fmt: skip
_OF_JOINTS = ("acceleration", "position", "friction")


@attrs.frozen
class Formulation:
    """The properties of a formulation.

    Attributes:
        name: its name in scenes, and of its module.
        needs_joints: it is for scenes with constraint rows; else for scenes without.
        accepts_redundant: constraint rows may depend on each other.
        is_exact: its accelerations satisfy the constraints, as implicit and multistep integrators
            require.
        has_own_coordinates: its state is not that of bodies, but of its module coordinates.py.
    """

    name: str
    needs_joints: bool = True
    accepts_redundant: bool = False
    is_exact: bool = True
    has_own_coordinates: bool = False

    @property
    def loops(self) -> tuple[str, ...]:
        """Kinds of the group loops that it calls."""
        return (*_ALL, *_OF_JOINTS) if self.needs_joints else _ALL

    def coordinates(self, evaluator: Any) -> Any:
        """The coordinates that it integrates (coordinates.py), for an evaluator.

        Raises:
            UnsuitableError: the model does not suit it.
        """
        if self.has_own_coordinates:
            module = import_module(f"dap3d_core.formulations.{self.name}.coordinates")
            return module.TreeCoordinates(evaluator)
        return import_module("dap3d_core.formulations.coordinates").BodyCoordinates(evaluator)


#: By name. Where a scene leaves the choice open, the first that fits it is taken.
FORMULATIONS = {
    formulation.name: formulation
    for formulation in (
        Formulation("unconstrained", needs_joints=False),
        Formulation("standard"),
        Formulation("penalty", accepts_redundant=True, is_exact=False),
        Formulation("lsq", accepts_redundant=True),
        Formulation("joint", accepts_redundant=True, has_own_coordinates=True),
    )
}
