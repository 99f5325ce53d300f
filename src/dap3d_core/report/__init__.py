"""Work-precision reports: speed against error of every method and integrator on a scene."""

from dap3d_core.registry.arguments import make_callable
from dap3d_core.report.measurement import Failed, MeasuredRun, RejectedSetting
from dap3d_core.report.reference import Reference
from dap3d_core.report.report import Recommendation, Report
from dap3d_core.report.runner import report
from dap3d_core.report.settings_ladder import Setting

__all__ = [
    "Failed", "Recommendation", "Reference", "RejectedSetting", "Report", "MeasuredRun", "Setting",
    "report",
]  # fmt: skip

make_callable(__name__, report)
