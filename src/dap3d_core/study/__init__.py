"""The study floor: many runs of one scene with other numbers."""

from dap3d_core.study.outputs import REDUCTIONS, Output, outputs_of
from dap3d_core.study.parameters import Number, all_numbers, names_under, numbers_named, with_values
from dap3d_core.study.study import Batch, Ensemble, PointStatus, Study

__all__ = [
    "REDUCTIONS",
    "Batch",
    "Ensemble",
    "Number",
    "Output",
    "PointStatus",
    "Study",
    "all_numbers",
    "names_under",
    "numbers_named",
    "outputs_of",
    "with_values",
]
