"""The formulations floor: accelerations and multipliers from a state."""

from importlib import import_module
from typing import Any

from dap3d_core.assembly.system import step_functions

#: Formulation -> the kinds of group loops that it calls.
LOOPS = {
    "unconstrained": ("value", "wrench", "energy"),
    "standard": ("value", "wrench", "energy", "acceleration", "position"),
}

#: Places of a formulation's functions in the list that an integrator takes.
RHS, PROJECT, REPORT = range(3)


def functions_of(method: str) -> Any:
    """A formulation's compiled (rhs, project, report) as the list that an integrator takes."""
    module: Any = import_module(f"dap3d_core.formulations.{method}")
    return step_functions(module.rhs, module.project, module.report)
