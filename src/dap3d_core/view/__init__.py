"""The view layer: a result as one page with a three-dimensional scene, plots and the ledger."""

import sys
from types import ModuleType
from typing import Any

from dap3d_core.view.page import View, view

__all__ = ["View", "view"]


class _CallableModule(ModuleType):
    """Lets ``dap3d_core.view(...)`` make a view whether or not this module is loaded."""

    def __call__(self, *arguments: Any, **options: Any) -> View:
        return view(*arguments, **options)


sys.modules[__name__].__class__ = _CallableModule
