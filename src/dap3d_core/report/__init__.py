"""Work-precision reports: speed against error of every method and integrator on a scene."""

import sys
from types import ModuleType
from typing import Any

from dap3d_core.report.measurement import Failed, MeasuredRun, RejectedSetting
from dap3d_core.report.reference import Reference
from dap3d_core.report.report import Recommendation, Report
from dap3d_core.report.runner import report
from dap3d_core.report.settings_ladder import Setting

__all__ = [
    "Failed",
    "Recommendation",
    "Reference",
    "RejectedSetting",
    "Report",
    "MeasuredRun",
    "Setting",
    "report",
]


class _CallableModule(ModuleType):
    """Makes ``dap3d_core.report(...)`` callable once this module is loaded."""

    def __call__(self, *arguments: Any, **options: Any) -> Report:
        return report(*arguments, **options)


sys.modules[__name__].__class__ = _CallableModule
