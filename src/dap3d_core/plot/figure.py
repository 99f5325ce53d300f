"""Figures as files, without a window."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dap3d_core.plot.curves import WIDTH, draw, gather, height_of
from dap3d_core.result import ResultError
from dap3d_core.result.file.atomic_write import whole_file

#: Suffix -> what keeps the time of day out of the file: equal figures give equal files.
FORMATS: dict[str, dict[str, Any]] = {
    ".png": {},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}
#: Least and largest side of a figure, inches; dots an inch.
SIDES, DENSITIES = (0.5, 100.0), (10.0, 1200.0)
#: What matplotlib falls back on where it cannot open windows.
FILES_ALONE = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
#: A window shows a figure larger than paper does.
WINDOW_DPI = 170.0
NO_WINDOW = (
    "cannot open a window: there is no display, or no package that opens windows (pip install "
    "PyQt6); -o writes a file instead"
)


def save_plot(
    result: Any,
    quantities: str | Sequence[str],
    path: str | os.PathLike[str],
    *,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    width: float = WIDTH,
    height: float | None = None,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw quantities of a result or a sweep as ``plot`` does, into a file; needs no display.

    Args:
        result: what to draw from; several runs as names and results; a sweep.
        quantities: one name or several.
        path: the file; its suffix says what it is, .png, .svg or .pdf.
        x: the quantity they are drawn over; time when left out.
        at: of a sweep: number -> value, as ``plot`` has it.
        width, height: size in inches; the height fits the number of panels when left out.
        dpi: dots an inch of a PNG.
        force: whether an existing file is overwritten.

    Returns:
        The path.

    Raises:
        UnknownNameError, ValueError: as ``plot``; also for a suffix or a size that cannot be.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    check_suffix(target)
    paint, fitting = painting(result, quantities, x, at)
    size = (width, fitting if height is None else height)
    return save_figure(paint, target, size, dpi, force=force)


def painting(
    result: Any, quantities: str | Sequence[str], x: str | None, at: Mapping[str, float] | None
) -> tuple[Callable[[Figure], object], float]:
    """What draws a figure of a result or a sweep, and a good height for it, inches.

    Raises:
        UnknownNameError, ValueError: as ``plot``.
    """
    names = [quantities] if isinstance(quantities, str) else list(quantities)
    if hasattr(result, "data_vars"):
        from dap3d_core.plot.sweep.sweep_plot import draw_sweep, gather_sweep

        found = gather_sweep(result, names, x, at)
        return (lambda figure: draw_sweep(figure, found)), found.height
    drawing = gather(result, names, x)
    return (lambda figure: draw(figure, drawing)), height_of(drawing)


def check_suffix(target: Path) -> str:
    """The suffix of a picture's file.

    Raises:
        ValueError: it is none of FORMATS.
    """
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"cannot write {target}: a figure is one of {', '.join(FORMATS)}")
    return suffix


def save_figure(
    paint: Callable[[Figure], object],
    target: Path,
    size: tuple[float, float],
    dpi: float,
    *,
    force: bool,
) -> Path:
    """Let something be drawn on an empty figure of a size (inches), and write it to a file.

    Raises:
        ValueError: a suffix or a size that cannot be.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    suffix = check_suffix(target)
    if not all(SIDES[0] <= s <= SIDES[1] for s in size):
        raise ValueError(
            f"a figure of {size[0]:g} x {size[1]:g} inches cannot be: each side is from "
            f"{SIDES[0]:g} to {SIDES[1]:g}"
        )
    if not DENSITIES[0] <= dpi <= DENSITIES[1]:
        raise ValueError(f"dpi is from {DENSITIES[0]:g} to {DENSITIES[1]:g}, not {dpi:g}")
    with fixed_files():
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        paint(figure)
        with whole_file(target, force) as part:
            figure.savefig(part, format=suffix[1:], dpi=dpi, metadata=FORMATS[suffix])
    return target


@contextmanager
def fixed_files() -> Iterator[None]:
    """Text in an SVG stays text; its identifiers do not change from run to run.

    No text is TeX, whatever the user's settings: names of a scene would be source code.
    """
    with matplotlib.rc_context(
        {"svg.hashsalt": "dap3d", "svg.fonttype": "none", "text.usetex": False}
    ):
        yield


def show_plot(
    result: Any,
    quantities: str | Sequence[str],
    *,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    width: float = WIDTH,
    height: float | None = None,
) -> None:
    """Draw quantities of a result as ``plot`` does, in a window; returns when it is closed.

    Args:
        result, quantities, x, at, width, height: as ``save_plot`` has them.

    Raises:
        UnknownNameError, ValueError: as ``plot``.
        ResultError: there is no display, or nothing to open windows with.
    """
    paint, fitting = painting(result, quantities, x, at)
    from matplotlib import pyplot

    size = (width, fitting if height is None else height)
    try:
        figure = pyplot.figure(figsize=size, layout="constrained", dpi=WINDOW_DPI)
    except ImportError as error:  # the environment names a way that does not work here
        raise ResultError(NO_WINDOW) from error
    if matplotlib.get_backend().lower() in FILES_ALONE:
        pyplot.close(figure)
        raise ResultError(NO_WINDOW)
    paint(figure)
    pyplot.show()
    pyplot.close(figure)
