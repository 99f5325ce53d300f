"""The report floor: speed against error of every method and integrator on a user's own scene."""

import sys
from types import ModuleType
from typing import Any

from dap3d_core.report.recommend import Recommendation
from dap3d_core.report.reference import Reference
from dap3d_core.report.report import Failed, Report, Run
from dap3d_core.report.runner import report
from dap3d_core.report.settings_ladder import Setting
from dap3d_core.report.timing import Refused

__all__ = [
    "Failed",
    "Recommendation",
    "Reference",
    "Refused",
    "Report",
    "Run",
    "Setting",
    "report",
]


class _CallableModule(ModuleType):
    """Lets ``dap3d_core.report(...)`` report whether or not this module is loaded."""

    def __call__(self, *arguments: Any, **options: Any) -> Report:
        return report(*arguments, **options)


sys.modules[__name__].__class__ = _CallableModule
