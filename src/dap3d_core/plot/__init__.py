"""Plot floor: quantities of a result as curves, in a window or a file; its motion as a film."""

import os
import sys
from types import ModuleType
from typing import Any


def _import_matplotlib() -> None:
    """Import matplotlib with the user's settings, not with those of the current folder.

    A ``matplotlibrc`` there may be that of a stranger's model, and may have names read as TeX.
    A script that has imported matplotlib before has decided for itself.
    """
    if "matplotlib" in sys.modules or not os.path.lexists("matplotlibrc"):
        return
    here = os.getcwd()
    os.chdir(os.path.abspath(os.sep))
    try:
        import matplotlib  # noqa: F401
    finally:
        os.chdir(here)


_import_matplotlib()

from dap3d_core.plot.figure import plot, save_plot, show_plot  # noqa: E402
from dap3d_core.plot.figure_file import FORMATS  # noqa: E402
from dap3d_core.plot.film.animation import Film, animate  # noqa: E402
from dap3d_core.plot.style import WIDTH  # noqa: E402

__all__ = ["FORMATS", "WIDTH", "Film", "animate", "plot", "save_plot", "show_plot"]


class _CallableModule(ModuleType):
    """Lets ``dap3d_core.plot(...)`` plot whether or not this module of the same name is loaded."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return plot(*arguments, **options)


sys.modules[__name__].__class__ = _CallableModule
