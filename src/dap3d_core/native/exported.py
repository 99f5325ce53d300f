"""A model on its way into files: its run, variables, outputs."""

from pathlib import Path

import attrs

from dap3d_core.native.build import Platform, build_objects, link
from dap3d_core.native.c_source import Variable, units_of
from dap3d_core.native.outputs import SYMBOL, Outputs
from dap3d_core.native.prepared import PreparedRun


@attrs.frozen
class Exported:
    """A model on its way into files.

    Attributes:
        prepared, variables: of the model.
        name: for files.
        outputs: with the function that computes them.
    """

    prepared: PreparedRun
    variables: list[Variable]
    name: str
    outputs: Outputs

    def link(self, source: Path, target: Platform, library: Path, archive: Path | None) -> int:
        """Make libraries of a C file, which has data.h beside it; bytes of the shared one."""
        objects = source.parent / target.name
        objects.mkdir(exist_ok=True)
        files = build_objects(units_of(self.prepared), (self.outputs.text, SYMBOL), target, objects)
        library.parent.mkdir(parents=True, exist_ok=True)
        link(source, files, target, library, archive)
        return library.stat().st_size
