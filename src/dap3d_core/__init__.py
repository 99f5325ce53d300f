"""dap3d: the motion of rigid bodies joined by joints, springs and drivers in three dimensions.

    import dap3d_core as dap
    result = dap.simulate(dap.load("pen1"), t_end=2.0)
    result.r, result.reaction("J1")["i"].force, result.ledger["energy"]

Every public name is here; each is imported when it is first used, so that importing the package
costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dap3d_core.exchange import export
    from dap3d_core.formats.import_model import import_matlab, import_model
    from dap3d_core.interface import PluginError
    from dap3d_core.native.export import export_model
    from dap3d_core.native.library import load_native
    from dap3d_core.plot import animate, plot
    from dap3d_core.registry import load_registry
    from dap3d_core.report import report
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene, SceneError, load, shipped_models
    from dap3d_core.scene.include import include
    from dap3d_core.simulation import (
        AssemblyError,
        Event,
        RedundantError,
        SimulationError,
        simulate,
    )
    from dap3d_core.simulation import compile_scene as compile
    from dap3d_core.simulation import open_result as open
    from dap3d_core.simulation.control.sampled import Controller
    from dap3d_core.simulation.equilibrium.equilibrium import Equilibrium, equilibrium
    from dap3d_core.simulation.kinematics.inverse import inverse
    from dap3d_core.simulation.kinematics.kinematics import kinematics
    from dap3d_core.simulation.linearization.linearization import Linearization, linearize
    from dap3d_core.simulation.rerun import rerun
    from dap3d_core.simulation.resume import resume
    from dap3d_core.simulation.stepwise.stepped_run import start
    from dap3d_core.study.equilibrium_path import EquilibriumPath, equilibrium_path
    from dap3d_core.study.fit.fit import fit
    from dap3d_core.study.fit.fit_parameters import Parameter
    from dap3d_core.study.fit.fit_result import Fit
    from dap3d_core.study.modes_over import ModesOver, modes_over
    from dap3d_core.study.sensitivities.objective import Objective, objective
    from dap3d_core.study.sensitivities.sensitivities import Sensitivities, sensitivities
    from dap3d_core.study.sweep.dataset import open_sweep
    from dap3d_core.study.sweep.sweep import sweep
    from dap3d_core.view import view

#: Module -> the names that it brings.
_PUBLIC = {
    "exchange": ("export",),
    "formats.import_model": ("import_matlab", "import_model"),
    "interface": ("PluginError",),
    "native.export": ("export_model",),
    "native.library": ("load_native",),
    "plot": ("animate", "plot"),
    "registry": ("load_registry",),
    "report": ("report",),
    "result": ("Result",),
    "scene": ("Scene", "SceneError", "load", "shipped_models"),
    "scene.include": ("include",),
    "simulation": ("AssemblyError", "Event", "RedundantError", "SimulationError", "simulate"),
    "simulation.control.sampled": ("Controller",),
    "simulation.equilibrium.equilibrium": ("Equilibrium", "equilibrium"),
    "simulation.kinematics.inverse": ("inverse",),
    "simulation.kinematics.kinematics": ("kinematics",),
    "simulation.linearization.linearization": ("Linearization", "linearize"),
    "simulation.rerun": ("rerun",),
    "simulation.resume": ("resume",),
    "simulation.stepwise.stepped_run": ("start",),
    "study.equilibrium_path": ("EquilibriumPath", "equilibrium_path"),
    "study.fit.fit": ("fit",),
    "study.fit.fit_parameters": ("Parameter",),
    "study.fit.fit_result": ("Fit",),
    "study.modes_over": ("ModesOver", "modes_over"),
    "study.sensitivities.objective": ("Objective", "objective"),
    "study.sensitivities.sensitivities": ("Sensitivities", "sensitivities"),
    "study.sweep.dataset": ("open_sweep",),
    "study.sweep.sweep": ("sweep",),
    "view": ("view",),
}
_HOMES = {name: (module, name) for module, names in _PUBLIC.items() for name in names}
_HOMES |= {"compile": ("simulation", "compile_scene"), "open": ("simulation", "open_result")}

__all__ = [
    "AssemblyError", "Controller", "Equilibrium", "EquilibriumPath", "Event", "Fit",
    "Linearization", "ModesOver", "Objective", "Parameter", "PluginError", "RedundantError",
    "Result", "Scene", "SceneError", "Sensitivities", "SimulationError", "animate", "compile",
    "equilibrium", "equilibrium_path", "export", "export_model", "fit", "import_matlab",
    "import_model", "include", "inverse", "kinematics", "linearize", "load", "load_native",
    "load_registry", "modes_over", "objective", "open", "open_sweep", "plot", "report", "rerun",
    "resume", "sensitivities", "shipped_models", "simulate", "start", "sweep", "view",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    layer, attribute = _HOMES[name]
    value = getattr(import_module(f"dap3d_core.{layer}"), attribute)
    if name not in ("plot", "report", "view"):  # modules have the same names
        globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
