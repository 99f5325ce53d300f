"""Studies: many runs of one scene with other values of its parameters."""

from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.outputs import REDUCTIONS, Output, outputs_of
from dap3d_core.study.parameters import (
    SceneParameter,
    all_parameters,
    names_under,
    parameters_named,
    with_values,
)
from dap3d_core.study.study import Batch, PointStatus, Study

__all__ = [
    "REDUCTIONS", "Batch", "Ensemble", "Output", "PointStatus", "SceneParameter", "Study",
    "all_parameters", "names_under", "outputs_of", "parameters_named", "with_values",
]  # fmt: skip
