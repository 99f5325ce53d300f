"""The plot floor: quantities of a result as curves, in a window or a file; its motion as a film."""

import sys
from types import ModuleType
from typing import Any

from dap3d_core.plot import matplotlib_settings  # noqa: F401  it sets matplotlib up  # isort: split
from dap3d_core.plot.curves import WIDTH, plot
from dap3d_core.plot.figure import FORMATS, save_plot, show_plot
from dap3d_core.plot.film.animation import Film, animate

__all__ = ["FORMATS", "WIDTH", "Film", "animate", "plot", "save_plot", "show_plot"]


class _CallableModule(ModuleType):
    """Lets ``dap3d_core.plot(...)`` plot whether or not this module of the same name is loaded."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return plot(*arguments, **options)


sys.modules[__name__].__class__ = _CallableModule
