"""Modules of LLVM IR compiled for a linker; a second process does half of them, on another core."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import attrs

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.background import core_count
from dap3d_core.kernels.compiler.objects import Processor

#: Cost of modules for which a second process, which starts in 0.3 s, pays.
LEAST = 10_000


@attrs.frozen
class Module:
    """A module of LLVM IR on its way into an object file.

    Attributes:
        text: the module.
        level: of optimisation.
        file: the object file.
    """

    text: str
    level: int
    file: Path

    @property
    def cost(self) -> int:
        """About 60 us each: lines, twice as much where the code is to be fast."""
        is_fast = self.level == objects.OPTIMISED and "minsize" not in self.text
        return self.text.count("\n") * (2 if is_fast else 1)


def compile_modules(modules: Sequence[Module], target: Processor) -> None:
    """Write the object files of modules for a processor."""
    here, there = _halves(modules)
    process = _started(there, target) if there else None
    _compile(here, target)
    if process is not None:
        process.wait()
    _compile([m for m in there if not m.file.exists()], target)  # it was ended, or did not start


def _halves(modules: Sequence[Module]) -> tuple[list[Module], list[Module]]:
    """Those that this process compiles, and those that a second one does, if that pays."""
    halves: tuple[list[Module], list[Module]] = [], []
    if core_count() < 2 or sum(m.cost for m in modules) < LEAST:
        return list(modules), []
    for module in sorted(modules, key=lambda m: -m.cost):
        min(halves, key=lambda half: sum(m.cost for m in half)).append(module)
    return halves


def _started(modules: Sequence[Module], target: Processor) -> "subprocess.Popen[bytes] | None":
    """A process that compiles modules; None where there can be none."""
    given = [target.triple, target.name]
    for module in modules:
        module.file.with_suffix(".ll").write_text(module.text, encoding="utf-8")
        given += [str(module.level), str(module.file)]
    try:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *given], stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    except OSError:
        return None


def _compile(modules: Sequence[Module], target: Processor) -> None:
    objects.initialise_all_targets()
    for module in modules:
        code = objects.compile_ir(module.text, module.level, target, is_linked=True)
        partial = module.file.with_suffix(".part")
        partial.write_bytes(code)
        partial.replace(module.file)


def main(triple: str, name: str, *given: str) -> None:
    """Compile modules: of each its level and its object file, beside which its text is."""
    pairs = zip(map(int, given[::2]), map(Path, given[1::2]), strict=True)
    modules = [Module(f.with_suffix(".ll").read_text("utf-8"), level, f) for level, f in pairs]
    _compile(modules, Processor(triple, name, ""))


if __name__ == "__main__":
    main(*sys.argv[1:])
