"""``dap3d models``: the shipped models."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal


@command("List the shipped models.", options.JSON)
def models() -> int:
    """List the shipped models."""
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.scene import shipped_models

    data = {name: _data(folder) for name, folder in shipped_models().items()}
    show_data({"models": data}, lambda console: _show(console, data))
    return DONE


def _show(console: "Terminal", data: dict[str, Any]) -> None:
    for group in dict.fromkeys(model["group"] for model in data.values()):
        rows = [
            (name, str(m["bodies"]), ", ".join(m["joints"]) or "-", m["description"])
            for name, m in data.items()
            if m["group"] == group
        ]
        if group:
            console.title(group)
        console.table(("model", "bodies", "joints", "what it is"), rows, right=(1,), fixed=(0,))
    if own := [name for name, model in data.items() if model["own_types"]]:
        console.say(f"With a type of its own, to be run with --allow-code: {', '.join(own)}")


def _data(folder: Path) -> dict[str, Any]:
    """A model as data; only its scene file is read."""
    from dap3d_core.scene import SceneError, load
    from dap3d_core.scene.files.read_toml import group_of
    from dap3d_core.scene.tables import PLUGIN_FILE

    data = {"group": group_of(folder), "folder": folder}
    try:
        scene = load(folder)
    except SceneError as error:
        return data | {"description": str(error), "bodies": 0, "joints": {}, "own_types": False}
    return data | {
        "description": str(scene.description),
        "bodies": len(scene.bodies),
        "joints": dict(Counter(str(joint.type) for joint in scene.joints.values())),
        "own_types": (folder / PLUGIN_FILE).is_file(),
    }
