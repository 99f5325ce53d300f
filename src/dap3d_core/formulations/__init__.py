"""Formulations: accelerations and multipliers from a state.

A formulation is a module of this package with the compiled functions ``rhs``, ``project`` and
``report`` (standard.py says what each does), and an entry of ``FORMULATIONS``.
"""

from importlib import import_module
from typing import Any

import attrs

from dap3d_core.assembly.arrays import step_functions

#: Indices of a formulation's functions in the list that an integrator takes.
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
        has_own_coordinates: its state is not that of bodies, but of the class ``Coordinates`` of
            its module coordinates.py; it has ``accepted`` and ``watch`` of its own, and no factors.
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

    def functions(
        self, *, turns: bool, switches: bool, contacts: bool = False, equations: str = ""
    ) -> Any:
        """Its compiled functions as the list that an integrator takes.

        They are rhs, project, report; accepted where ``turns`` are counted; watch for ``switches``,
        of ``contacts`` the one that finds multipliers.

        equations: the module that has them, where it is not the one of the formulation's name.
        """
        name = "contacts.equations" if contacts else equations or self.name
        module: Any = import_module(f"dap3d_core.formulations.{name}")
        of_switches = module
        functions = [module.rhs, module.project, module.report]
        if turns or switches:
            if not self.has_own_coordinates:
                module = import_module("dap3d_core.formulations.common.switching_functions")
            functions.append(module.accepted)
            if switches:
                functions.append(of_switches.watch if contacts else module.watch)
        return step_functions(*functions)

    def coordinates(self, evaluator: Any) -> Any:
        """The coordinates that it integrates, for an evaluator.

        Raises:
            UnsuitableError: the model does not suit it.
        """
        package = f"dap3d_core.formulations{f'.{self.name}' if self.has_own_coordinates else ''}"
        return import_module(f"{package}.coordinates").Coordinates(evaluator)


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
