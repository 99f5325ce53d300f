"""The formulations floor: accelerations and multipliers from a state."""

from importlib import import_module
from typing import Any

from dap3d_core.assembly.arrays import step_functions

#: Group loops of every formulation, and those of joints; each is there where the scene needs it.
_ALL = ("value", "wrench", "energy", "angle", "turned", "switch", "knot")
_WITH_JOINTS = (*_ALL, "acceleration", "position", "friction")

#: Formulation -> the kinds of group loops that it calls.
LOOPS = {
    "unconstrained": _ALL,
    "standard": _WITH_JOINTS,
    "penalty": _WITH_JOINTS,
    "lsq": _WITH_JOINTS,
}

#: Places of a formulation's functions in the list that an integrator takes.
RHS, PROJECT, REPORT, ACCEPTED, WATCH = range(5)


#: Formulations that do large scenes in two halves: module and least number of bodies.
IN_HALVES = {"standard": ("standard_in_halves", 500)}


def functions_of(method: str, *, turns: bool, switches: bool, halved: bool = False) -> Any:
    """A formulation's compiled functions as the list that an integrator takes.

    They are rhs, project, report; accepted where ``turns`` are counted; watch for ``switches``.
    ``halved``: whether the scene's plan is cut in two halves.
    """
    name = IN_HALVES[method][0] if halved and method in IN_HALVES else method
    module: Any = import_module(f"dap3d_core.formulations.{name}")
    functions = [module.rhs, module.project, module.report]
    if turns or switches:
        from dap3d_core.formulations.common.switching_functions import accepted, watch

        functions += [accepted, watch] if switches else [accepted]
    return step_functions(*functions)
