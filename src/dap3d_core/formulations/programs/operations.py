"""What the programs of a scene compute: their operations, by the functions that they come from."""

import re
import sys
from collections import Counter
from collections.abc import Mapping
from types import FrameType

import attrs

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations import PROJECT, RHS, WATCH
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.programs.scene_program import (
    MOST_INSTRUCTIONS,
    programmed,
    python_loops,
    write_program,
)
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler.straight_line import StraightLine

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


@attrs.frozen
class ProgramOperations:
    """Operations of a program, without those that no result needs.

    Attributes:
        name: "right-hand side", "projection" with the right-hand side before it, or "switches".
        parts: function -> kind of operation -> how many, the largest first.
        guards: conditions that are tested, all at once.
    """

    name: str
    parts: dict[str, dict[str, int]]
    guards: int

    @property
    def total(self) -> dict[str, int]:
        """Kind of operation -> how many in all."""
        return {kind: sum(part[kind] for part in self.parts.values()) for kind in KINDS}


class _Counting(StraightLine):
    """Notes which function of the core each instruction comes from."""

    def __init__(self, loops: Mapping[str, str]) -> None:
        """Args: name of a module -> the loop over instances of a type that it holds."""
        super().__init__(MOST_INSTRUCTIONS)
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


def operations(evaluator: Evaluator, time: float, state: Floats) -> list[ProgramOperations]:
    """The operations of the programs of a scene, at a state as projections are given.

    Raises:
        TraceError, CompileError: it has none; says why.
    """
    names = dict.fromkeys(("name", "counter", "general"), "program")
    written = [write(group.type_info, kind) for kind, group in evaluator.loop_groups]
    loops = {
        loop.__module__: source.name
        for loop, source in zip(python_loops(evaluator), written, strict=True)
        if source is not None
    }
    found = []
    for k in programmed(evaluator):
        tracer = _Counting(loops)
        text, _ = write_program(evaluator, k, time, state, names, tracer=tracer)
        body = text.partition("program:")[2].partition("general:")[0].splitlines()
        counts = _counts(body, tracer.owner)
        found.append(ProgramOperations(NAMES[k], counts, len(tracer.guards)))
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
