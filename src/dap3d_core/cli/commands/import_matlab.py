"""``dap3d import-matlab``: a scene from the files of a model of the MATLAB program DAP3D."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE

if TYPE_CHECKING:
    from dap3d_core.matlab import ImportReport
    from dap3d_core.scene import Scene

#: Arrays of a scene, and what one member is, in words.
HELD = (
    ("bodies", "body", "bodies"),
    ("points", "point", "points"),
    ("vectors", "vector", "vectors"),
    ("vectors2", "vector of type 2", "vectors of type 2"),
    ("joints", "joint", "joints"),
    ("forces", "force", "forces"),
    ("functions", "function", "functions"),
)


@click.command(
    "import-matlab", cls=Command, saves=True, short_help="Make a scene of a MATLAB model."
)
@click.argument("folder")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    default="scene.toml",
    show_default=True,
    help="The scene file to write, or an existing folder for its scene.toml.",
)
@click.option("--force", is_flag=True, help="Overwrite what exists.")
@click.option(
    "--stub", is_flag=True, help="Write a plugin.py for user_force.m too, to be filled in."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def import_matlab(folder: str, *, output: str, force: bool, stub: bool, as_json: bool) -> int:
    """Make a scene of a model of the MATLAB program DAP3D.

    FOLDER holds the files of the model: inBodies.m, inPoints.m, inVectors1.m, inVectors2.m,
    inJoints.m, inForces.m, inFuncts.m, inAnimate.m. They are read, never run: assignments of
    numbers, matrices, words and structures are understood, anything else is refused with its line.

    user_force.m is not translated: it is shown, and --stub writes a plugin.py to be filled in.

    The report says what was read, defaulted, changed and left out. Needs the extra "matlab".
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import output as console
    from dap3d_core.cli.console.console import print_json
    from dap3d_core.cli.framework.paths import write_text

    scene, report = dap.import_matlab(folder)
    sources = tuple(Path(folder) / f.name for f in report.files)
    target = _target(output, force=force, sources=sources)
    plugin = None
    if stub and report.stub:
        plugin = _target(str(target.parent / "plugin.py"), force=force, sources=sources)
    scene.save(target)
    if plugin is not None:
        write_text(plugin, report.stub)
    if as_json:
        print_json(_data(scene, report, target, plugin))
    else:
        _show(console(), scene, report, target, plugin, stub=stub)
    return DONE


def _target(output: str, *, force: bool, sources: tuple[Path, ...]) -> Path:
    """The file to write; refused where it may not be written."""
    from dap3d_core.cli.framework.paths import writable

    path = Path(output)
    path = path / "scene.toml" if path.is_dir() else path
    return writable(path, force=force, sources=sources)


def _data(
    scene: "Scene", report: "ImportReport", target: Path, plugin: Path | None
) -> dict[str, Any]:
    import attrs

    return {
        "scene": target,
        "plugin": plugin,
        "holds": {table: len(getattr(scene, table)) for table, _, _ in HELD},
        **attrs.asdict(report),
    }


def _show(
    console: Any,
    scene: "Scene",
    report: "ImportReport",
    target: Path,
    plugin: Path | None,
    *,
    stub: bool,
) -> None:
    from dap3d_core.cli.console.console import count, facts, items, say, show, table, title
    from dap3d_core.cli.console.run_summary import show_notes

    title(console, f"MATLAB model {scene.name}")
    rows = [(f.name, f.state, f.holds) for f in report.files]
    show(console, table(("file", "was", "holds"), rows, fixed=(0, 1)))
    for heading, remarks in (
        ("defaulted (the files leave it out)", report.defaulted),
        ("changed", report.changed),
        ("left out", report.unused),
    ):
        if remarks:
            title(console, heading)
            items(console, [str(r) for r in remarks])
    show_notes(console, report.notes)
    if report.user_force:
        _show_user_force(console, report, plugin)
    held = [count(len(getattr(scene, t)), one, many) for t, one, many in HELD if getattr(scene, t)]
    pairs = [("scene", f"{target}: {', '.join(held)}"), ("plugin", str(plugin or ""))]
    facts(console, pairs)
    if stub and not report.stub:
        say(console, "No force is of type user: there is no plugin to fill in.")
    code = " --allow-code" if report.user_force else ""
    say(console, "A MATLAB model says nothing of the time. Simulate it with:")
    say(console, f"dap3d run {target} --t-end 2 --dt 0.02{code}", indent=4, whole=True)


def _show_user_force(console: Any, report: "ImportReport", plugin: Path | None) -> None:
    from dap3d_core.cli.console.console import say, title

    title(console, "user_force.m (not translated)")
    say(console, report.user_force.strip("\n"), indent=4, whole=True)
    if plugin is not None:
        say(console, f"Write its law into {plugin}; until then a run is refused.", "yellow")
        return
    title(console, "plugin.py, to be filled in (--stub writes it beside the scene)")
    say(console, report.stub.strip("\n"), indent=4, whole=True)
