"""Plot layer: quantities of a result as curves, in a window or a file; its motion as a film."""

import logging
import os
import sys


def _import_matplotlib() -> None:
    """Import matplotlib with the user's settings, not with those of the current folder.

    A ``matplotlibrc`` there may be that of a stranger's model, and may have names read as TeX.
    A script that has imported matplotlib before has decided for itself. That its own cache cannot
    be kept, where the home folder cannot be written, matters to nobody here.
    """
    if "matplotlib" in sys.modules:
        return
    here = os.getcwd() if os.path.lexists("matplotlibrc") else None
    if here is not None:
        os.chdir(os.path.abspath(os.sep))
    log = logging.getLogger("matplotlib")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        import matplotlib  # noqa: F401
    except ValueError as error:
        backend = os.environ.get("MPLBACKEND")
        if not backend:
            raise
        raise OSError(
            f"the environment variable MPLBACKEND is {backend!r}, which is no backend of "
            "matplotlib; name one, such as Agg, or unset it"
        ) from error
    finally:
        log.setLevel(level)
        if here is not None:
            os.chdir(here)


_import_matplotlib()

from dap3d_core.plot.figure import plot, save_plot, show_plot  # noqa: E402
from dap3d_core.plot.figure_file import FORMATS  # noqa: E402
from dap3d_core.plot.film.animation import Film, animate  # noqa: E402
from dap3d_core.plot.style import WIDTH  # noqa: E402
from dap3d_core.registry.arguments import make_callable  # noqa: E402

__all__ = ["FORMATS", "WIDTH", "Film", "animate", "plot", "save_plot", "show_plot"]

make_callable(__name__, plot)
