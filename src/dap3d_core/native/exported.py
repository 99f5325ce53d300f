"""A model on its way into files: its run, variables, outputs."""

from pathlib import Path

import attrs

from dap3d_core.native.build import Platform, build_objects, link
from dap3d_core.native.c_source import Variable, units_of
from dap3d_core.native.run.directions import Directions
from dap3d_core.native.run.outputs import SYMBOL, Outputs
from dap3d_core.native.run.prepared import PreparedRun


@attrs.frozen
class Exported:
    """A model on its way into files.

    Attributes:
        prepared, variables: of the model.
        name: for files.
        outputs: with the function that computes them.
        directions: directional derivatives; None where a function has none.
    """

    prepared: PreparedRun
    variables: list[Variable]
    name: str
    outputs: Outputs
    directions: Directions | None

    def link(self, source: Path, target: Platform, library: Path, archive: Path | None) -> int:
        """Make libraries of a C file, which has data.h beside it; bytes of the shared one."""
        objects = source.parent / target.name
        objects.mkdir(exist_ok=True)
        texts = [(self.outputs.text, SYMBOL)]
        if self.directions is not None:
            texts.append((self.directions.text, self.directions.symbol))
        units = units_of(self.prepared, self.directions)
        files = build_objects(units, texts, target, objects)
        library.parent.mkdir(parents=True, exist_ok=True)
        link(source, files, target, library, archive)
        return library.stat().st_size
