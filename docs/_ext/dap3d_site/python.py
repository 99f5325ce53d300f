"""Reference of the Python API: everything public, and what it returns."""

from collections.abc import Iterator

from dap3d_site.markdown import code, directive, page

#: Sections of the page: title, public names of ``dap3d_core``, and classes that they hand out.
SECTIONS = {
    "Scenes": (
        ("load", "shipped_models", "Scene", "include", "import_matlab", "import_model",
         "export_model", "load_native"),
        ("scene.Simulation", "scene.Body", "scene.Animation", "scene.Mistake",
         "dap3d_matlab.files.report.ImportReport", "formats.import_model.ImportReport",
         "formats.export_model.ExportReport", "native.export.NativeExport",
         "native.library.NativeLibrary", "native.library.NativeRun"),
    ),
    "Runs": (
        ("simulate", "compile", "Event", "Controller", "start", "resume", "rerun"),
        ("simulation.CompiledModel", "simulation.Instant", "simulation.RunProgress",
         "simulation.Reproduction", "simulation.control.state_view.StateView",
         "simulation.stepwise.stepped_run.SteppedRun"),
    ),
    "Analyses": (
        ("equilibrium", "equilibrium_path", "kinematics", "inverse", "linearize", "modes_over",
         "Equilibrium", "EquilibriumPath", "Linearization", "ModesOver"),
        (),
    ),
    "Results": (
        ("Result", "open", "plot", "view", "animate", "export"),
        ("result.Reaction", "result.Energy", "result.Entry", "result.ErrorEstimate",
         "result.EventRecord", "result.contact_table.ContactTable", "result.Note",
         "result.Quantity", "result.post.joint_coordinates.JointCoordinates",
         "result.RunStatistics", "plot.Film"),
    ),
    "Studies": (
        ("sweep", "open_sweep", "fit", "Fit", "Parameter", "sensitivities", "Sensitivities",
         "objective", "Objective"),
        (),
    ),
    "Reports": (
        ("report",),
        ("report.Report", "report.MeasuredRun", "report.Setting", "report.Recommendation",
         "report.Reference"),
    ),
    "Types": (("load_registry",), ("registry.Registry", "registry.PluginInfo")),
    "Errors": (
        ("SceneError", "PluginError", "SimulationError", "AssemblyError", "RedundantError"),
        ("registry.UnknownTypeError", "result.UnknownNameError", "simulation.CheckpointError"),
    ),
}  # fmt: skip


def pages() -> Iterator[tuple[str, str]]:
    """The page of the Python API: (path, text)."""
    yield "reference/python.md", page("Python", *_parts())


def _parts() -> Iterator[str]:
    yield "All of these are names of `dap3d_core`, imported as `dap` on the other pages."
    for title, (public, others) in SECTIONS.items():
        yield f"## {title}"
        for name in public:
            yield _documented(f"dap3d_core.{name}")
        if others:
            listed = ", ".join(code(name.rpartition(".")[2]) for name in others)
            yield f"What they hand out, or take: {listed}."
        for name in others:
            yield _documented(f"dap3d_core.{name}")


def _documented(path: str) -> str:
    """The directive that shows something public."""
    path = path.removeprefix("dap3d_core.") if "dap3d_matlab" in path else path
    name = path.rpartition(".")[2]
    if name.endswith("Error"):
        return directive("autoexception", path, ":show-inheritance:")
    if name[0].isupper():
        inherited = "\n:inherited-members:" if name == "Result" else ""  # its arrays of motion
        return directive("autoclass", path, f":members:{inherited}")
    return directive("autofunction", path)
