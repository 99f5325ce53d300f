"""Work-precision diagrams: wall time against error, a line for each method and integrator."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from dap3d_core.plot import style
from dap3d_core.plot.figure_file import save_figure

#: Inches.
HEIGHT = 4.0
#: Grey of the line of the fastest runs, and of the band below the reference's uncertainty.
FRONT, BAND = "0.82", "0.93"


class Mark(NamedTuple):
    """One run: its method, its integrator, its error, its wall time (s), True on the front."""

    method: str
    integrator: str
    error: float
    time_s: float
    on_front: bool


def save_work_precision(
    marks: Sequence[Mark],
    path: str | os.PathLike[str],
    title: str = "",
    uncertainty: float | None = None,
    *,
    width: float = style.WIDTH,
    height: float = HEIGHT,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw runs as time against error into a file; needs no display. Returns the path.

    Args:
        marks: the runs; those of one method and integrator make a line, in their order.
        path: the file; its suffix gives the format, .png, .svg or .pdf.
        title: of the picture.
        uncertainty: of the reference; a band shows errors below it, which mean nothing.
        width, height: size in inches.
        dpi: dots an inch of a PNG.
        force: overwrites an existing file.

    Raises:
        ValueError: no runs; an invalid suffix or size.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    drawn = [mark for mark in marks if mark.error > 0.0 and mark.time_s > 0.0]
    if not drawn:
        raise ValueError("there is no run with an error above zero to draw")
    paint = partial(draw_work_precision, marks=drawn, title=title, uncertainty=uncertainty)
    return save_figure(paint, Path(path), (width, height), dpi, force=force)


def draw_work_precision(
    figure: Figure, marks: Sequence[Mark], title: str, uncertainty: float | None
) -> Axes:
    """Draw on an empty figure: colours for integrators, dashes and markers for methods."""
    ax = figure.subplots()
    integrators = list(dict.fromkeys(mark.integrator for mark in marks))
    methods = list(dict.fromkeys(mark.method for mark in marks))
    front = sorted((m for m in marks if m.on_front), key=lambda m: m.time_s)
    ax.plot([m.error for m in front], [m.time_s for m in front], color=FRONT, linewidth=7.0,
            solid_capstyle="round", zorder=1, label="_front")  # fmt: skip
    for i, integrator in enumerate(integrators):
        for j, method in enumerate(methods):
            line = [m for m in marks if (m.method, m.integrator) == (method, integrator)]
            if line:
                ax.plot([m.error for m in line], [m.time_s for m in line], **_line_style(i, j),
                        label=f"{method}, {integrator}".strip("_"))  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    _set_ticks(ax)
    if uncertainty:
        low, high = ax.get_xlim()
        ax.axvspan(min(low, uncertainty), uncertainty, color=BAND, zorder=0)
        ax.set_xlim(low, high)
    style.style_axes(ax, "error e", "wall time")
    keys = [Line2D([], [], color=style.PALETTE[i % len(style.PALETTE)], linewidth=2.5, label=name)
            for i, name in enumerate(integrators)]  # fmt: skip
    keys += [Line2D([], [], **(_line_style(0, j) | {"color": "0.25"}), label=name)
             for j, name in enumerate(methods)]  # fmt: skip
    greys = [(FRONT, "fastest"), (BAND, "below uncertainty")][: 2 if uncertainty else 1]
    keys += [Line2D([], [], color=grey, linewidth=7.0, label=label) for grey, label in greys]
    style.legend_below(figure, keys, 2, line_length=2.4)
    if title:
        ax.set_title(style.shown_text(title), fontsize=style.LETTERS + 1)
    return ax


def _set_ticks(ax: Axes) -> None:
    """Few ticks with few letters: powers of ten; of times that span little also 2 and 5."""
    low, high = ax.get_ylim()
    between = (1.0, 2.0, 5.0) if high < 300.0 * low else (1.0,)
    ax.yaxis.set_major_locator(LogLocator(subs=between, numticks=12))
    ax.yaxis.set_major_formatter(
        FuncFormatter(lambda s, _: f"{1e3 * s:g} ms" if s < 1.0 else f"{s:g} s")
    )
    ax.xaxis.set_major_locator(LogLocator(numticks=7))
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_minor_locator(NullLocator())


def _line_style(integrator: int, method: int) -> dict[str, Any]:
    return {
        "color": style.PALETTE[integrator % len(style.PALETTE)],
        "linestyle": style.DASHES[method % len(style.DASHES)],
        "marker": style.MARKERS[method % len(style.MARKERS)],
        "markersize": 4.5,
        "markerfacecolor": "white",
        "linewidth": 1.4,
    }
