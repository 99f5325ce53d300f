"""Figures as PNG, SVG and PDF files; no display is needed."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dap3d_core.result.file.atomic_write import whole_file

#: Suffix -> metadata that keep the time of day out of the file: equal figures give equal files.
FORMATS: dict[str, dict[str, Any]] = {
    ".png": {},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}
#: Least and largest side of a figure, inches; dots an inch.
SIDES, DENSITIES = (0.5, 100.0), (10.0, 1200.0)


def check_suffix(target: Path) -> str:
    """Returns the suffix of a picture's file; a ValueError where it is none of FORMATS."""
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
    """Call ``paint`` on an empty figure of a size (inches), and write it to a file.

    Raises:
        ValueError: invalid suffix, size or dpi.
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
    """Keep text in an SVG as text, and its identifiers the same from run to run.

    No text is TeX, whatever the user's settings: names of a scene would be source code.
    """
    settings: Any = {"svg.hashsalt": "dap3d", "svg.fonttype": "none", "text.usetex": False}
    with matplotlib.rc_context(settings):
        yield
