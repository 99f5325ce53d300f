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

_HOMES = {
    "AssemblyError": ("simulation", "AssemblyError"),
    "Controller": ("simulation.control.sampled", "Controller"),
    "Equilibrium": ("simulation.equilibrium.equilibrium", "Equilibrium"),
    "EquilibriumPath": ("study.equilibrium_path", "EquilibriumPath"),
    "Event": ("simulation", "Event"),
    "Fit": ("study.fit.fit_result", "Fit"),
    "Linearization": ("simulation.linearization.linearization", "Linearization"),
    "ModesOver": ("study.modes_over", "ModesOver"),
    "Objective": ("study.sensitivities.objective", "Objective"),
    "Parameter": ("study.fit.fit_parameters", "Parameter"),
    "PluginError": ("interface", "PluginError"),
    "RedundantError": ("simulation", "RedundantError"),
    "Result": ("result", "Result"),
    "Scene": ("scene", "Scene"),
    "SceneError": ("scene", "SceneError"),
    "Sensitivities": ("study.sensitivities.sensitivities", "Sensitivities"),
    "SimulationError": ("simulation", "SimulationError"),
    "animate": ("plot", "animate"),
    "compile": ("simulation", "compile_scene"),
    "equilibrium": ("simulation.equilibrium.equilibrium", "equilibrium"),
    "equilibrium_path": ("study.equilibrium_path", "equilibrium_path"),
    "export": ("exchange", "export"),
    "export_model": ("native.export", "export_model"),
    "fit": ("study.fit.fit", "fit"),
    "import_matlab": ("formats.import_model", "import_matlab"),
    "import_model": ("formats.import_model", "import_model"),
    "include": ("scene.include", "include"),
    "inverse": ("simulation.kinematics.inverse", "inverse"),
    "kinematics": ("simulation.kinematics.kinematics", "kinematics"),
    "linearize": ("simulation.linearization.linearization", "linearize"),
    "load": ("scene", "load"),
    "load_native": ("native.library", "load_native"),
    "load_registry": ("registry", "load_registry"),
    "modes_over": ("study.modes_over", "modes_over"),
    "objective": ("study.sensitivities.objective", "objective"),
    "open": ("simulation", "open_result"),
    "open_sweep": ("study.sweep.dataset", "open_sweep"),
    "plot": ("plot", "plot"),
    "report": ("report", "report"),
    "sensitivities": ("study.sensitivities.sensitivities", "sensitivities"),
    "shipped_models": ("scene", "shipped_models"),
    "rerun": ("simulation.rerun", "rerun"),
    "resume": ("simulation.resume", "resume"),
    "simulate": ("simulation", "simulate"),
    "start": ("simulation.stepwise.stepped_run", "start"),
    "sweep": ("study.sweep.sweep", "sweep"),
    "view": ("view", "view"),
}

__all__ = [
    "AssemblyError",
    "Controller",
    "Equilibrium",
    "EquilibriumPath",
    "Event",
    "Fit",
    "Linearization",
    "ModesOver",
    "Objective",
    "Parameter",
    "PluginError",
    "RedundantError",
    "Result",
    "Scene",
    "SceneError",
    "Sensitivities",
    "SimulationError",
    "animate",
    "compile",
    "equilibrium",
    "equilibrium_path",
    "export",
    "export_model",
    "fit",
    "import_matlab",
    "import_model",
    "include",
    "inverse",
    "kinematics",
    "linearize",
    "load",
    "load_native",
    "load_registry",
    "modes_over",
    "objective",
    "open",
    "open_sweep",
    "plot",
    "report",
    "rerun",
    "resume",
    "sensitivities",
    "shipped_models",
    "simulate",
    "start",
    "sweep",
    "view",
]


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
