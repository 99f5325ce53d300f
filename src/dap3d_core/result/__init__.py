"""The result layer: what a run left behind, on disk and in memory; the post-processor's arrays."""

from dap3d_core.result.errors import Computed, ResultError, UnknownNameError
from dap3d_core.result.event_record import EventRecord
from dap3d_core.result.file.atomic_write import check_target
from dap3d_core.result.file.write import ResultWriter
from dap3d_core.result.metadata import RunMetadata, RunStatistics, current_versions
from dap3d_core.result.note import Note, information, warnings_of
from dap3d_core.result.open import open_result
from dap3d_core.result.post.force_output import Reaction
from dap3d_core.result.post.global_error import ErrorEstimate, estimated_error
from dap3d_core.result.post.ledger import Entry
from dap3d_core.result.post.point_motion import Energy
from dap3d_core.result.quantities.catalogue import Quantity
from dap3d_core.result.quantities.lookup import find, names_of
from dap3d_core.result.result import Result

__all__ = [
    "Computed", "Energy", "Entry", "ErrorEstimate", "EventRecord", "Note", "Quantity", "Reaction",
    "RunMetadata", "Result", "ResultError", "ResultWriter", "RunStatistics", "UnknownNameError",
    "check_target", "current_versions", "estimated_error", "find", "information", "names_of",
    "open_result", "warnings_of",
]  # fmt: skip
