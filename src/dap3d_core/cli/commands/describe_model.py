"""The part of ``dap3d describe`` that explains a model: what its results will have."""

import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel


def is_model(word: str) -> bool:
    """True for the name of a shipped model, a file or a folder."""
    from dap3d_core.scene import shipped_models

    return word in shipped_models() or os.path.exists(word)  # no error for impossible paths


def model_data(model: str, *, allow_code: bool) -> dict[str, Any]:
    """The description of a model as data: its parts, joint coordinates, parameters, outputs.

    Raises:
        SceneError, PluginError: as ``compile``.
    """
    import dap3d_core as dap
    from dap3d_core.result import find
    from dap3d_core.simulation.output.check_outputs import probe_of

    compiled = dap.compile(model, allow_code=allow_code)
    probe, scene = probe_of(compiled.scene_text, compiled.evaluator), compiled.scene
    resolved = compiled.checked.scene.parameters
    return {
        "name": str(scene.name),
        "description": str(scene.description),
        "bodies": list(compiled.model.body_names),
        "points": list(compiled.model.point_names),
        "joints": _joints(compiled, probe),
        "forces": [{"name": n, "type": str(f.type)} for n, f in scene.forces.items()],
        "parameters": [
            {"name": name, "value": resolved[name], "given": given}
            for name, given in scene.parameters.items()
        ],
        "outputs": [
            {"name": name, "expression": expression.text, "unit": quantity.unit,
             "components": list(quantity.components)}
            for name, expression in probe.outputs.items()
            for quantity in [find(probe, name)]
        ],
    }  # fmt: skip


def _joints(compiled: "CompiledModel", probe: "Result") -> list[dict[str, Any]]:
    """Joints with their coordinates, or the reason why there are none."""
    from dap3d_core.result import UnknownNameError

    joints = []
    for name, element in compiled.scene.joints.items():
        coordinates, reason = [], ""
        try:
            known = probe.coordinates(name)
        except UnknownNameError as error:
            reason = str(error).partition(": ")[2]
        else:
            alias = {place: word for word, place in known.aliases.items()}
            coordinates = [
                {"name": f"{name}.q{k + 1}", "alias": alias.get(k, ""), "unit": unit}
                for k, unit in enumerate(known.units)
            ]
        joints.append({"name": name, "type": str(element.type), "coordinates": coordinates,
                       "reason": reason})  # fmt: skip
    return joints


def show_model(console: "Terminal", data: dict[str, Any]) -> None:
    """Print the description of a model."""
    from dap3d_core.cli.console.console import count, scene_name
    from dap3d_core.registry.suggestions import some

    console.title(scene_name(data["name"]))
    if data["description"]:
        console.prose(data["description"])
    console.facts([
        ("bodies", f"{count(len(data['bodies']), 'body', 'bodies')}: {some(data['bodies'], 8)}"),
        ("points", some(data["points"], 8) if data["points"] else ""),
        ("forces", ", ".join(f"{f['name']} ({f['type']})" for f in data["forces"][:20])),
    ])  # fmt: skip
    if data["joints"]:
        console.title("joints")
        rows = [(j["name"], j["type"], _coordinates_text(j)) for j in data["joints"]]
        console.table(("joint", "type", "coordinates"), rows, fixed=(0, 1))
    if data["parameters"]:
        console.title("parameters")
        rows = [(p["name"], f"{p['value']:.6g}", str(p["given"])) for p in data["parameters"]]
        console.table(("parameter", "value", "given"), rows, fixed=(0, 1))
    if data["outputs"]:
        console.title("outputs")
        rows = [(o["name"], o["unit"], o["expression"]) for o in data["outputs"]]
        console.table(("output", "unit", "is"), rows, fixed=(0, 1))


def _coordinates_text(joint: dict[str, Any]) -> str:
    """Names and units of the coordinates of a joint."""
    names = [
        f"{joint['name']}.{c['alias'] or c['name'].rpartition('.')[2]} [{c['unit']}]"
        for c in joint["coordinates"]
    ]
    return ", ".join(names) or f"none: {joint['reason']}"
