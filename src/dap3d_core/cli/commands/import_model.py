"""``dap3d import``: a scene made of a model of another program."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.formats.import_model import ImportReport
    from dap3d_core.scene import Scene


@command(
    "Make a scene of a URDF, SDF, MJCF or MATLAB model.",
    click.argument("file", type=click.Path()),
    options.output("The folder for the scene and its meshes; by default that of the file's name, "
                   "in the current folder.", metavar="FOLDER"),
    click.option("-f", "--format", "kind", metavar="NAME",
                 help="The importer: urdf, sdf, mjcf, matlab or one of a plugin; by default by the "
                 "file."),
    click.option("--package", "packages", multiple=True, metavar="NAME=FOLDER",
                 help="The folder of a package, for files package://NAME/...; may be repeated."),
    click.option("--root", type=click.Path(), metavar="FOLDER",
                 help="Files that the model names must lie in it; by default the file's folder."),
    click.option("--key", metavar="NAME", help="Start at a keyframe of MJCF, with its controls."),
    click.option("--position", "positions", multiple=True, metavar="JOINT=VALUE",
                 help="Start a joint there, in rad or m, as the file counts them (qpos of MJCF); "
                 "several numbers with commas. Joints that are coupled with it follow. May be "
                 "repeated."),
    click.option("--limits", type=click.Choice(["off", "soft", "hard"]), default="soft",
                 help="Limits of joints: soft stops, by default; hard ones, at which a rate ends "
                 "at once; or off."),
    click.option("--contacts", is_flag=True,
                 help="Let shapes meet each other, by time stepping."),
    click.option("--free-base", is_flag=True,
                 help="Free the base, where the format leaves open whether it is fixed."),
    click.option("--keep-fixed", is_flag=True, help="Keep fixed joints; do not merge their links."),
    click.option("--balance-inertia", is_flag=True,
                 help="Replace moments of inertia that no body has by their mean."),
    click.option("--no-shapes", is_flag=True, help="Leave shapes out; their files are not read."),
    click.option("--strict", is_flag=True, help="Refuse a model if something would be left out."),
    click.option("--allow-code", is_flag=True,
                 help="Evaluate the expressions of a xacro file, which are code."),
    click.option("--arg", "arguments", multiple=True, metavar="NAME:=VALUE",
                 help="An argument of a xacro file; may be repeated."),
    click.option("--stub", is_flag=True,
                 help="Write a plugin.py for code of a MATLAB model too, to be filled in."),
    options.FORCE, options.JSON,
    saves=True, name="import",
)  # fmt: skip
def import_model(
    file: str,
    *,
    output: str | None,
    kind: str | None,
    packages: tuple[str, ...],
    positions: tuple[str, ...],
    no_shapes: bool,
    arguments: tuple[str, ...],
    stub: bool,
    force: bool,
    **given: Any,
) -> int:
    """Make a scene of a model of another program.

    FILE is a URDF, xacro, SDF or MJCF file, or the folder of a MATLAB model. Links that fixed
    joints hold together become one body, closed loops stay closed, shapes and meshes are drawn.

    \b
    dap3d import arm.urdf                 write arm/scene.toml and arm/meshes/
    dap3d run arm

    The report says what was taken, what the scene says in another way, and what is left out, each
    with its line.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.formats.import_model import ImportReport

    folder = Path(output or Path(file).resolve().stem)
    if folder.is_file() or (folder.suffix == ".toml" and not folder.is_dir()):
        why = "is a file" if folder.is_file() else "looks like a file"
        raise Refused(f"{folder} {why}; -o names the folder for scene.toml and the meshes")
    scene, report = dap.import_model(
        file, format=kind, packages=_pairs("--package", packages), shapes=not no_shapes,
        arguments=_pairs("--arg", arguments, ":="), positions=_numbers(positions), **given,
    )  # fmt: skip
    _make(folder)
    if not isinstance(report, ImportReport):
        from dap3d_core.cli.commands.import_matlab import write_folder

        return write_folder(scene, report, folder / "scene.toml", force=force, stub=stub)
    target = _save(scene, report, folder, Path(file), force=force)
    data = {"scene": target} | _as_data(report)
    show_data(data, lambda console: _show(console, scene, report, target))
    return DONE


def _save(scene: "Scene", report: "ImportReport", folder: Path, file: Path, *, force: bool) -> Path:
    """Write the scene and its meshes into a folder."""
    from dap3d_core.cli.framework.paths import writable

    sources = (file, *report.meshes)
    for name in ("scene.toml", *report.meshes.values()):
        _make((folder / name).parent)
        writable(folder / name, force=force, sources=sources)
    try:
        return report.save(scene, folder, force=True)
    except OSError as error:
        raise Refused(f"cannot write {folder}: {error.strerror or error}") from error


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refused(f"cannot make the folder {folder}: {error.strerror or error}") from error


def _pairs(option: str, words: tuple[str, ...], sign: str = "=") -> dict[str, str]:
    """NAME=VALUE words as a dictionary; arguments of macros may be empty, as in ROS."""
    pairs = {}
    for word in words:
        name, equals, value = word.partition(sign)
        if not (name and equals and (value or sign == ":=")):
            raise Refused(f"{option} {word}: write NAME{sign}VALUE")
        if name in pairs:
            raise Refused(f"{option} {word}: {name} is given more than once")
        pairs[name] = value
    return pairs


def _numbers(words: tuple[str, ...]) -> dict[str, list[float]]:
    numbers = {}
    for name, value in _pairs("--position", words).items():
        try:
            numbers[name] = [float(part) for part in value.split(",")]
        except ValueError:
            raise Refused(f"--position {name}={value}: {value!r} is no number") from None
    return numbers


def _as_data(report: "ImportReport") -> dict[str, Any]:
    """The report for a program: each remark with its file and line."""

    def remarks(listed: Any) -> list[dict[str, Any]]:
        return [
            {"file": one.place.file, "line": one.place.line, "text": one.text,
             "count": one.count, "motion": one.motion}
            for one in listed
        ]  # fmt: skip

    return {
        "file": report.file, "format": report.format, "taken": report.taken,
        "translated": remarks(report.translated), "left_out": remarks(report.left_out),
        "notes": list(report.notes), "meshes": sorted(report.meshes.values()),
    }  # fmt: skip


def _show(console: "Terminal", scene: "Scene", report: "ImportReport", target: Path) -> None:
    from dap3d_core.cli.console.console import count

    console.title(f"{report.format} model {scene.name}")
    taken = ", ".join(count(n, part.removesuffix("s")) for part, n in report.taken.items() if n)
    console.facts([("taken", taken)])
    both = {"translated with a difference": report.translated, "left out": report.left_out}
    for motion, word in ((True, " (the motion is another)"), (False, "")):
        for heading, remarks in both.items():
            lines = [str(one) for one in remarks if one.motion == motion]
            console.section(f"{heading}{word}", lines)
    console.section("notes", list(report.notes))
    parts = (scene.bodies, "body", "bodies"), (scene.joints, "joint"), (scene.forces, "force")
    holds = ", ".join(count(len(part), *words) for part, *words in parts)
    console.facts([("scene", f"{target}: {holds}"), ("meshes", str(len(report.meshes) or ""))])
    console.say("Simulate it with:")
    console.say(f"dap3d run {target.parent}", indent=4, whole=True)
