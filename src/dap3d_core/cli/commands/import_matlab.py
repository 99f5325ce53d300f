"""``dap3d import-matlab``: a scene made of a model of the MATLAB program."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.scene import Scene

#: Tables of a scene, with the nouns of their entries.
TABLES = (
    ("bodies", "body", "bodies"),
    ("points", "point", "points"),
    ("vectors", "vector", "vectors"),
    ("vectors2", "vector of type 2", "vectors of type 2"),
    ("joints", "joint", "joints"),
    ("forces", "force", "forces"),
    ("functions", "function", "functions"),
)


@command(
    "Make a scene of a MATLAB model.",
    click.argument("folder"),
    options.output("The scene file to write, or an existing folder for its scene.toml.",
                  default="scene.toml", show_default=True),
    options.FORCE,
    click.option("--stub", is_flag=True,
                 help="Write a plugin.py for user_force.m too, to be filled in."),
    options.JSON,
    saves=True,
)  # fmt: skip
def import_matlab(folder: str, *, output: str, force: bool, stub: bool) -> int:
    """Make a scene of a model of the MATLAB program DAP3D, as ``dap3d import FOLDER`` does.

    FOLDER holds the files of the model: inBodies.m, inPoints.m, inVectors1.m, inVectors2.m,
    inJoints.m, inForces.m, inFuncts.m, inAnimate.m. They are read, never run: assignments of
    numbers, matrices, words and structures are understood, anything else is refused with its line.

    user_force.m is not translated: it is shown, and --stub writes a plugin.py to be filled in.

    The report says what was read, defaulted, changed and left out. Needs the extra "matlab".
    """
    import dap3d_core as dap

    scene, report = dap.import_matlab(folder)
    path = Path(output)
    path = path / "scene.toml" if path.is_dir() else path
    return write_folder(scene, report, path, force=force, stub=stub)


def write_folder(scene: "Scene", report: Any, path: Path, *, force: bool, stub: bool) -> int:
    """Write the scene of a folder, a plugin.py to be filled in, and the report."""
    import attrs

    from dap3d_core.cli.console.console import show_data
    from dap3d_core.cli.framework.paths import SCENES, writable, write_text

    sources = tuple(Path(report.folder) / f.name for f in report.files)
    target = writable(path, force=force, sources=sources, kinds=SCENES)
    plugin = None
    if stub and report.stub:
        plugin = writable(target.parent / "plugin.py", force=force, sources=sources)
    scene.save(target, force=True)
    if plugin is not None:
        write_text(plugin, report.stub)
    holds = {table: len(getattr(scene, table)) for table, _, _ in TABLES}
    data = {"scene": target, "plugin": plugin, "holds": holds, **attrs.asdict(report)}
    show_data(data, lambda console: _show(console, scene.name, report, data, stub=stub))
    return DONE


def _show(
    console: "Terminal", name: str | None, report: Any, data: dict[str, Any], *, stub: bool
) -> None:
    from dap3d_core.cli.console.console import count

    target, plugin = data["scene"], data["plugin"]
    console.title(f"{report.title} model {name}")
    rows = [(f.name, f.state, f.holds) for f in report.files]
    console.table(("file", "was", "holds"), rows, fixed=(0, 1))
    console.section("defaulted (the files leave it out)", [str(r) for r in report.defaulted])
    console.section("changed", [str(r) for r in report.changed])
    console.section("left out", [str(r) for r in report.unused])
    console.section("notes", report.notes)
    if report.user_force:
        _show_user_force(console, report, plugin)
    sizes = ((data["holds"][table], one, many) for table, one, many in TABLES)
    holds = ", ".join(count(number, one, many) for number, one, many in sizes if number)
    console.facts([("scene", f"{target}: {holds}"), ("plugin", str(plugin or ""))])
    if stub and not report.stub:
        console.say("No force is of type user: there is no plugin to fill in.")
    code = " --allow-code" if report.user_force else ""
    console.say(f"A {report.title} model does not say how long to simulate. Simulate it with:")
    console.say(f"dap3d run {target} --t-end 2 --dt 0.02{code}", indent=4, whole=True)


def _show_user_force(console: "Terminal", report: Any, plugin: Path | None) -> None:
    console.title("user_force.m (not translated)")
    console.say(report.user_force.strip("\n"), indent=4, whole=True)
    if plugin is not None:
        console.say(f"Write its law into {plugin}; until then a run is refused.", "yellow")
        return
    console.title("plugin.py, to be filled in (--stub writes it next to the scene)")
    console.say(report.stub.strip("\n"), indent=4, whole=True)
