"""``dap3d models``: the models that come with it."""

from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE


@click.command(cls=Command, short_help="List the shipped models.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def models(*, as_json: bool) -> int:
    """List the shipped models."""
    from dap3d_core.cli.console.console import output, print_json, say, show, table, title
    from dap3d_core.scene import shipped_models

    found = {name: _facts(folder) for name, folder in shipped_models().items()}
    if as_json:
        print_json({"models": found})
        return DONE
    console = output()
    for group in dict.fromkeys(f["group"] for f in found.values()):
        rows = [
            (name, str(f["bodies"]), ", ".join(f["joints"]) or "-", f["description"])
            for name, f in found.items()
            if f["group"] == group
        ]
        if group:
            title(console, group)
        columns = ("model", "bodies", "joints", "what it is")
        show(console, table(columns, rows, right=(1,), fixed=(0,)))
    if any(f["own_types"] for f in found.values()):
        own = ", ".join(name for name, f in found.items() if f["own_types"])
        say(console, f"With a type of its own, to be run with --allow-code: {own}")
    return DONE


def _facts(folder: Path) -> dict[str, Any]:
    """Description, bodies and joints of a model; only its scene file is read."""
    from dap3d_core.scene import SceneError, load
    from dap3d_core.scene.files.read_toml import group_of
    from dap3d_core.scene.scene import PLUGIN_FILE

    group = group_of(folder)
    try:
        scene = load(folder)
    except SceneError as error:
        return {
            "group": group,
            "description": str(error),
            "bodies": 0,
            "joints": {},
            "own_types": False,
            "folder": folder,
        }
    joints: dict[str, int] = {}
    for joint in scene.joints.values():
        joints[str(joint.type)] = joints.get(str(joint.type), 0) + 1
    return {
        "group": group,
        "description": str(scene.description),
        "bodies": len(scene.bodies),
        "joints": joints,
        "own_types": (folder / PLUGIN_FILE).is_file(),
        "folder": folder,
    }
