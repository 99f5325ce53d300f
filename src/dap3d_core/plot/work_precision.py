"""Work-precision diagrams: wall time against error, a line for each method and integrator."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from dap3d_core.plot.curves import DASHES, MARKERS, PALETTE, shown_text
from dap3d_core.plot.figure import save_figure

#: Inches. Letters of 8 points are still 5 points high where the picture is set 60 mm wide.
WIDTH, HEIGHT = 3.8, 4.0
LETTERS = 8.0


class Mark(NamedTuple):
    """One run: its method, its integrator, its error, its wall time (s), whether on the front."""

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
    width: float = WIDTH,
    height: float = HEIGHT,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw runs as time against error into a file; needs no display.

    Args:
        marks: the runs; those of one method and integrator make a line, in their order.
        path: the file; its suffix says what it is, .png, .svg or .pdf.
        title: of the picture.
        uncertainty: of the reference: errors below it cannot be told, which a band shows.
        width, height: size in inches.
        dpi: dots an inch of a PNG.
        force: whether an existing file is overwritten.

    Returns:
        The path.

    Raises:
        ValueError: no runs; a suffix or a size that cannot be.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    drawn = [mark for mark in marks if mark.error > 0.0 and mark.time_s > 0.0]
    if not drawn:
        raise ValueError("there is no run with an error above zero to draw")

    def paint(figure: Figure) -> None:
        draw_work_precision(figure, drawn, title, uncertainty)

    return save_figure(paint, Path(path), (width, height), dpi, force=force)


def draw_work_precision(
    figure: Figure, marks: Sequence[Mark], title: str, uncertainty: float | None
) -> Axes:
    """Draw on an empty figure: colours tell integrators, dashes and markers tell methods."""
    ax = figure.subplots()
    integrators = list(dict.fromkeys(mark.integrator for mark in marks))
    methods = list(dict.fromkeys(mark.method for mark in marks))
    front = sorted((m for m in marks if m.on_front), key=lambda m: m.time_s)
    ax.plot([m.error for m in front], [m.time_s for m in front], color="0.82", linewidth=7.0,
            solid_capstyle="round", zorder=1, label="_front")  # fmt: skip
    for i, integrator in enumerate(integrators):
        for j, method in enumerate(methods):
            line = [m for m in marks if (m.method, m.integrator) == (method, integrator)]
            if line:
                ax.plot(
                    [m.error for m in line],
                    [m.time_s for m in line],
                    **_look(i, j),
                    label=f"{method}, {integrator}".strip("_"),
                )
    ax.set_xscale("log")
    ax.set_yscale("log")
    _tick(ax)
    if uncertainty:
        low, high = ax.get_xlim()
        ax.axvspan(min(low, uncertainty), uncertainty, color="0.93", zorder=0)
        ax.set_xlim(low, high)
    ax.set_xlabel("error e", fontsize=LETTERS)
    ax.set_ylabel("wall time", fontsize=LETTERS)
    ax.tick_params(labelsize=LETTERS)
    ax.grid(True, alpha=0.3, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    figure.legend(
        handles=_keys(integrators, methods, banded=bool(uncertainty)),
        loc="outside lower center", ncols=2, fontsize=LETTERS, frameon=False,
        handlelength=2.4, columnspacing=1.0, borderaxespad=0.1,
    )  # fmt: skip
    if title:
        ax.set_title(shown_text(title), fontsize=LETTERS + 1)
    return ax


def _tick(ax: Axes) -> None:
    """Few ticks with few letters: powers of ten; of times that span little also 2 and 5."""
    low, high = ax.get_ylim()
    between = (1.0, 2.0, 5.0) if high < 300.0 * low else (1.0,)
    ax.yaxis.set_major_locator(LogLocator(subs=between, numticks=12))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _time(value)))
    ax.xaxis.set_major_locator(LogLocator(numticks=7))
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_minor_locator(NullLocator())


def _time(value: float) -> str:
    """A time on the axis."""
    return f"{1e3 * value:g} ms" if value < 1.0 else f"{value:g} s"


def _look(integrator: int, method: int) -> dict[str, Any]:
    return {
        "color": PALETTE[integrator % len(PALETTE)],
        "linestyle": DASHES[method % len(DASHES)],
        "marker": MARKERS[method % len(MARKERS)],
        "markersize": 4.5,
        "markerfacecolor": "white",
        "linewidth": 1.4,
    }


def _keys(integrators: Sequence[str], methods: Sequence[str], *, banded: bool) -> list[Line2D]:
    """The legend: a colour for each integrator, a marker for each method, the front, the band."""
    keys = []
    for i, name in enumerate(integrators):
        keys.append(Line2D([], [], color=PALETTE[i % len(PALETTE)], linewidth=2.5, label=name))
    for j, name in enumerate(methods):
        keys.append(Line2D([], [], **(_look(0, j) | {"color": "0.25"}), label=name))
    keys.append(Line2D([], [], color="0.82", linewidth=7.0, label="fastest"))
    if banded:
        keys.append(Line2D([], [], color="0.93", linewidth=7.0, label="below uncertainty"))
    return keys
