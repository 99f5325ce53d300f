"""The result floor: what a run left behind, on disk and in memory; the post-processor's arrays."""

from dap3d_core.result.errors import ResultError, UnknownNameError
from dap3d_core.result.estimate import ErrorEstimate, estimated_error
from dap3d_core.result.files import check_target
from dap3d_core.result.ledger import Entry
from dap3d_core.result.motion import Energy
from dap3d_core.result.occurrence import Occurrence
from dap3d_core.result.quantities import Quantity, find, names_of
from dap3d_core.result.reactions import Reaction
from dap3d_core.result.reading import open_result
from dap3d_core.result.record import INFORMATION, Record, Statistics, current_versions
from dap3d_core.result.result import Result
from dap3d_core.result.writing import ResultWriter

__all__ = [
    "INFORMATION",
    "Energy",
    "Entry",
    "ErrorEstimate",
    "Occurrence",
    "Quantity",
    "Reaction",
    "Record",
    "Result",
    "ResultError",
    "ResultWriter",
    "Statistics",
    "UnknownNameError",
    "check_target",
    "current_versions",
    "estimated_error",
    "find",
    "names_of",
    "open_result",
]
