"""Data of a study: the work at each point, and the outputs of its points."""

from collections.abc import Sequence
from enum import IntEnum

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats
from dap3d_core.result import Result
from dap3d_core.scene import Scene
from dap3d_core.simulation import SimulationError
from dap3d_core.study.outputs import Output


class PointStatus(IntEnum):
    """Outcome of the run at a point of a study."""

    OPEN = 0  # not run so far
    DONE = 1
    STOPPED = 2  # early: outputs are of what was computed
    FAILED = 3  # it could not begin: outputs are NaN


@attrs.frozen
class Study:
    """The work at each point, as plain data that can be sent to other processes.

    Attributes:
        scene: with the settings of the runs in its ``simulation``.
        names: dotted names of the parameters that vary.
        outputs: computed from each run.
        allow_code: whether the model's own types may be loaded.
        gradients: whether derivatives of the outputs by the parameters are computed, too.
    """

    scene: Scene
    names: tuple[str, ...]
    outputs: tuple[Output, ...]
    allow_code: bool = False
    gradients: bool = False


def derivative_name(name: str) -> str:
    """Name of the derivatives of an output."""
    return f"d {name}"


@attrs.frozen(eq=False)
class Batch:
    """Outputs of k points.

    Attributes:
        status: (k,) ``PointStatus`` of each.
        notes: (k,) warning or error message of each, "" for none.
        values: name of an output -> (k,), or (k, nt) of a series; NaN where there is none. Those of
            derivatives have the p parameters behind: (k, p), (k, nt, p).
    """

    status: NDArray[np.int8]
    notes: list[str]
    values: dict[str, Floats]

    @classmethod
    def empty(cls, outputs: Sequence[Output], count: int, nt: int, p: int = 0) -> "Batch":
        """A batch of points that are still to be run; p: parameters of derivatives."""
        shapes: dict[str, tuple[int, ...]] = {
            o.name: (count, nt) if o.reduction == "series" else (count,) for o in outputs
        }
        if p:
            shapes |= {derivative_name(name): (*shape, p) for name, shape in shapes.items()}
        values = {name: np.full(shape, np.nan) for name, shape in shapes.items()}
        return cls(np.zeros(count, dtype=np.int8), [""] * count, values)

    def store(self, k: int, result: Result, outputs: Sequence[Output]) -> None:
        """Store outputs of a result as those of point k, which fails if one of them raises."""
        try:
            for output in outputs:
                value = np.atleast_1d(output.value(result))
                if output.reduction == "series":
                    self.values[output.name][k, : len(value)] = value
                else:
                    self.values[output.name][k] = value[0]
        except SimulationError as error:  # a function of the user's
            self.status[k], self.notes[k] = PointStatus.FAILED, str(error)
            for values in self.values.values():
                values[k] = np.nan
