"""The part of ``dap3d describe`` that explains a model: results and operations of its programs."""

import os
import re
import sys
from collections import Counter
from collections.abc import Mapping
from types import FrameType
from typing import TYPE_CHECKING, Any

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations import PROJECT, RHS, WATCH
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.programs import scene_program
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler.straight_line import StraightLine

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel


NAMES = {RHS: "right-hand side", PROJECT: "projection", WATCH: "switches"}
#: Packages whose functions are named; what they call for arithmetic belongs to them.
NAMED = ("assembly", "formulations", "linear")
#: Kinds of operations, and the instructions that they are.
KINDS = {
    "loads": ("load",),
    "sums and products": ("fadd", "fsub", "fmul", "fneg"),
    "quotients and roots": ("fdiv", "sqrt"),
    "choices": ("fcmp", "select", "and", "or", "xor"),
    "calls": ("call",),
}
_LINE = re.compile(r"\s*(?:(%[\w.]+) = )?(.*)")


class _Counting(StraightLine):
    """Notes which function of the core each instruction comes from."""

    def __init__(self, loops: Mapping[str, str]) -> None:
        """Args: name of a module -> the loop over instances of a type that it holds."""
        super().__init__(scene_program.MOST_INSTRUCTIONS)
        self._loops = loops
        self.owner: dict[str, str] = {}

    def new(self, text: str) -> str:
        name = super().new(text)
        if name not in self.owner:
            self.owner[name] = self._owner(sys._getframe(1))
        return name

    def _owner(self, frame: FrameType | None) -> str:
        """The function of the core, or the kernels of a type, that a frame was called by."""
        while frame is not None:
            module = frame.f_globals.get("__name__", "")
            if module in self._loops:
                return self._loops[module]
            _, _, place = module.partition("dap3d_core.")
            if place.partition(".")[0] in NAMED and ".programs" not in place:
                return f"{place.rpartition('.')[2]}.{frame.f_code.co_name}"
            frame = frame.f_back
        return "results"


def operations(evaluator: Evaluator, time: float, state: Floats) -> list[dict[str, Any]]:
    """The operations of the programs of a scene, at a state as projections are given.

    Those that no result needs do not count.

    Returns:
        of each program its ``name``; in ``parts`` function -> kind of operation -> how many, the
        largest first; ``total``, kind -> how many in all; ``guards``, conditions that are tested.

    Raises:
        TraceError, CompileError: it has none; says why.
    """
    names = dict.fromkeys(("name", "counter", "general"), "program")
    written = [write(group.type_info, kind) for kind, group in evaluator.loop_groups]
    loops = {
        loop.__module__: source.name
        for loop, source in zip(scene_program.python_loops(evaluator), written, strict=True)
        if source is not None
    }
    found = []
    for k in scene_program.programmed(evaluator):
        tracer = _Counting(loops)
        text, _ = scene_program.write_program(evaluator, k, time, state, names, tracer=tracer)
        body = text.partition("program:")[2].partition("general:")[0].splitlines()
        parts = _counts(body, tracer.owner)
        total = {kind: sum(part[kind] for part in parts.values()) for kind in KINDS}
        guards = len(tracer.guards)
        found.append({"name": NAMES[k], "guards": guards, "total": total, "parts": parts})
    return found


def _counts(lines: list[str], owner: dict[str, str]) -> dict[str, dict[str, int]]:
    """Operations of each part that stores and guards need, read from the last line to the first."""
    needed: set[str] = set()
    parts: dict[str, Counter[str]] = {}
    for line in reversed(lines):
        found = _LINE.match(line)
        assert found is not None
        name, text = found.groups()
        if name and name not in needed:
            continue
        needed.update(re.findall(r"%[\w.]+", text))
        word = text.partition(" ")[0]
        kind = next((k for k, words in KINDS.items() if word in words), None)
        kind = None if text.startswith("load ptr") else kind
        if kind == "calls" and ".sqrt" in text:
            kind = "quotients and roots"
        if name and kind:
            parts.setdefault(owner.get(name, "results"), Counter())[kind] += 1
    ordered = sorted(parts, key=lambda part: -sum(parts[part].values()))
    return {part: {kind: parts[part][kind] for kind in KINDS} for part in ordered}


#: Parts of a program that are shown, and short names of kinds of operations.
MOST_PARTS = 15
ABBREVIATED = {
    "loads": "loads", "sums and products": "+ - *", "quotients and roots": "/ sqrt",
    "choices": "choices", "calls": "calls",
}  # fmt: skip


def is_model(word: str) -> bool:
    """True for the name of a shipped model, a file or a folder."""
    from dap3d_core.scene import shipped_models

    return word in shipped_models() or os.path.exists(word)  # no error for impossible paths


def model_data(model: str, *, allow_code: bool, source: bool = False) -> dict[str, Any]:
    """The description of a model as data: its parts, joint coordinates, parameters, outputs.

    With ``source``, also the operations of its program (formulations/programs).

    Raises:
        SceneError, PluginError: as ``compile``.
    """
    import dap3d_core as dap
    from dap3d_core.result import find
    from dap3d_core.simulation.explain import contacts_of
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
        "contacts": [
            {"name": name, "type": str(one.type_info.type.keyword)}
            for name, one in contacts_of(compiled.checked).items()
        ],
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
    } | (_programs(compiled) if source else {})  # fmt: skip


def _programs(compiled: "CompiledModel") -> dict[str, Any]:
    """The operations of the programs of a model, or the reason why there are none."""
    from dap3d_core.formulations.programs.change_over import MOST_BODIES
    from dap3d_core.integrators.stepping.integration import off_constraints
    from dap3d_core.kernels.compiler.trace import TraceError
    from dap3d_core.kernels.compiler.types import CompileError

    evaluator, settings = compiled.new_evaluator(), compiled.scene.simulation
    about: dict[str, Any] = {"method": compiled.method, "programs": []}
    if not 0 < evaluator.model.body_count <= MOST_BODIES:
        return about | {"reason": f"scenes of up to {MOST_BODIES} bodies have programs"}
    start = compiled.start(bool(settings.correct), settings.hold, str(settings.correct_metric))
    state = off_constraints(evaluator.coordinates.start(start.u))
    evaluator.start(0.0, start.u)
    try:
        return about | {"programs": operations(evaluator, 0.0, state)}
    except (TraceError, CompileError) as error:
        return about | {"reason": f"the scene has no program of its own: {error}"}


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
        ("contacts", ", ".join(f"{c['name']} ({c['type']})" for c in data["contacts"][:20])),
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
    if "reason" in data:
        console.prose(data["reason"])
    for program in data.get("programs", ()):
        _show_program(console, program, data["method"])


def _show_program(console: "Terminal", program: dict[str, Any], method: str) -> None:
    """Print the operations of a program by part, the largest ones first."""
    from dap3d_core.cli.console.console import count

    total, parts = program["total"], program["parts"]
    console.title(f"{program['name']}, by method {method}")
    console.prose(
        f"{count(sum(total.values()), 'operation')} and {count(program['guards'], 'guard')}"
    )
    shown = dict(list(parts.items())[:MOST_PARTS])
    if others := list(parts.values())[MOST_PARTS:]:
        summed = {kind: sum(part[kind] for part in others) for kind in total}
        shown[f"{len(others)} others"] = summed
    rows = [(name, *(f"{n:,}" if n else "" for n in part.values()))
            for name, part in {**shown, "all": total}.items()]  # fmt: skip
    right = tuple(range(1, len(total) + 1))
    console.table(("part", *(ABBREVIATED[kind] for kind in total)), rows, right=right)


def _coordinates_text(joint: dict[str, Any]) -> str:
    """Names and units of the coordinates of a joint."""
    names = [
        f"{joint['name']}.{c['alias'] or c['name'].rpartition('.')[2]} [{c['unit']}]"
        for c in joint["coordinates"]
    ]
    return ", ".join(names) or f"none: {joint['reason']}"
