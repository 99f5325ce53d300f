"""Panels of a plot of a sweep: lines, scattered points, maps, families of curves, bands; style."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats
from dap3d_core.plot import style
from dap3d_core.plot.sweep.sweep_table import DONE, Variable
from dap3d_core.study import PointStatus

#: More points of a line, or of a map, have no marks of their own.
MARKED, MARKED_ON_MAP = 60, 400
#: A map whose greatest value is so many times its median has logarithmic colours.
STEEP = 30.0
#: Percentiles between which a band lies.
BAND = 5.0, 95.0
#: Cells of a map without a value.
HATCHED: dict[str, Any] = {"hatch": "////", "facecolor": "0.96", "edgecolor": "0.72"}

Status = NDArray[np.int8]
Mask = NDArray[np.bool_]

#: Colours of values, which colour-blind readers can order; of lines without the light end.
COLORS: Colormap = colormaps["viridis"]
LINE_COLORS: Colormap = ListedColormap(COLORS(np.linspace(0.0, 0.88, 256)), name="viridis_lines")
#: Status of points without a value -> label, marker, colour.
STATUS_STYLE = {
    PointStatus.OPEN.value: ("not run so far", "o", "0.55"),
    DONE: ("without a value", "s", "#CC79A7"),
    PointStatus.STOPPED.value: ("stopped early", "^", "#E69F00"),
    PointStatus.FAILED.value: ("failed", "x", "#D55E00"),
}


class StatusLegend:
    """The legend below the panels: meaning of marks, and numbers of points."""

    def __init__(self) -> None:
        self._handles: dict[str, Any] = {}

    def add(self, handle: Any) -> None:
        """Add a handle, once for each label."""
        self._handles.setdefault(str(handle.get_label()), handle)

    def add_counts(self, status: Status, missing: Mask) -> None:
        """Add numbers of points by status, without a mark."""
        for code, here in by_status(status, missing):
            self.add(Line2D([], [], linestyle="", label=count_label(code, here)))

    def mark(self, ax: Axes, status: Status, missing: Mask, x: Any, y: Any) -> None:
        """Mark points without a value at x, y (n,); y None: above the lower edge."""
        for code, here in by_status(status, missing):
            _, marker, color = STATUS_STYLE[code]
            look: dict[str, Any] = dict(marker=marker, color=color, markersize=4.5, linestyle="",
                                         markerfacecolor="none", markeredgewidth=1.1)  # fmt: skip
            transform = ax.get_xaxis_transform() if y is None else ax.transData
            height = np.full(int(here.sum()), 0.035) if y is None else y[here]
            ax.plot(x[here], height, transform=transform, clip_on=False, zorder=5, **look)
            self.add(Line2D([], [], label=count_label(code, here), **look))

    @property
    def handles(self) -> list[Any]:
        """The handles, each with its label."""
        return list(self._handles.values())

    def draw(self, figure: Figure) -> None:
        """Draw the legend, where it has any entry."""
        if self._handles:
            columns = style.columns_of(list(self._handles), figure.get_figwidth() - 0.2)
            style.legend_below(figure, self.handles, columns)


def by_status(status: Status, missing: Mask) -> Iterator[tuple[int, Mask]]:
    """The points without a value by their status: code and mask."""
    for code in STATUS_STYLE:
        here = missing & (status == code)
        if here.any():
            yield code, here


def count_label(code: int, here: Mask) -> str:
    """Label of points of a status, with their number."""
    return f"{STATUS_STYLE[code][0]} ({int(here.sum())})"


class Panel(ABC):
    """One panel of a figure."""

    @property
    def height(self) -> float:
        """A suitable height, inches."""
        return style.PANEL_HEIGHT

    @abstractmethod
    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """Draw the panel, of a size in inches; adds to the legend of the figure."""


def norm_of(values: Floats, is_log: bool = False) -> Normalize:
    """Map from values to colours; equal values have the middle one."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return Normalize(0.0, 1.0)
    low, high = float(finite.min()), float(finite.max())
    if not high > low:
        room = 0.5 * abs(low) or 1.0
        return Normalize(low - room, high + room)
    return LogNorm(low, high) if is_log else Normalize(low, high)


def label_bar(bar: Any, variable: Variable, height: float) -> None:
    """Label a colour bar next to a panel of a height, inches."""
    bar.ax.tick_params(labelsize=style.LETTERS)
    bar.ax.yaxis.get_offset_text().set_fontsize(style.LETTERS)
    label = style.with_unit(variable.label, variable.unit)
    bar.set_label(style.folded(label, 13 * (height - 0.6)), fontsize=style.LETTERS)


@attrs.frozen(eq=False)
class Lines(Panel):
    """Outputs of one unit over a number; gaps where there is no value."""

    x: Variable
    outputs: list[Variable]
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """The outputs, and marks below them of points without a value."""
        x = self.x.values
        for k, output in enumerate(self.outputs):
            self._draw(ax, k, output)
        missing = np.any([~np.isfinite(o.values) for o in self.outputs], axis=0)
        _extend_down(ax, missing)
        legend.mark(ax, self.status, missing & np.isfinite(x), x, None)
        _label_axes(ax, self.x, self.outputs, size)

    def _draw(self, ax: Axes, k: int, output: Variable) -> None:
        """A line, its points marked where they are few."""
        x, few = self.x.values, len(self.x.values) <= MARKED
        look: dict[str, Any] = dict(color=style.PALETTE[k % len(style.PALETTE)], markersize=3.5)
        marker = style.MARKERS[k % len(style.MARKERS)]
        ax.plot(x, output.values, marker=marker if few else "",
                linestyle=style.DASHES[k // len(style.PALETTE) % len(style.DASHES)], linewidth=1.4,
                label=style.shown_text(output.name), **look)  # fmt: skip
        finite = np.concatenate([[False], np.isfinite(output.values), [False]])
        alone = finite[1:-1] & ~finite[:-2] & ~finite[2:]
        if not few and alone.any():  # a value between two gaps makes no line
            ax.plot(x[alone], output.values[alone], marker=marker, linestyle="", **look)


@attrs.frozen(eq=False)
class Scatter(Lines):
    """Outputs of one unit over a number or an output, a dot for each point."""

    def _draw(self, ax: Axes, k: int, output: Variable) -> None:
        """Dots; the more there are, the fainter each is."""
        count = len(self.x.values)
        marker = style.MARKERS[k % len(style.MARKERS)]
        ax.plot(self.x.values, output.values, marker=marker, linestyle="",
                markersize=3.5 if count < 500 else 2.5, markeredgewidth=0.0,
                alpha=float(np.clip((300.0 / count) ** 0.5, 0.15, 0.85)),
                color=style.PALETTE[k % len(style.PALETTE)], label=style.shown_text(output.name),
                rasterized=count > 2000)  # fmt: skip


def _extend_down(ax: Axes, missing: Mask) -> None:
    """Leave room below the curves for marks, where there are any."""
    if missing.any():
        low, high = ax.get_ylim()
        ax.set_ylim(low - 0.08 * (high - low), high)


@attrs.frozen(eq=False)
class Heat(Panel):
    """One output over two numbers, as colours; hatched where it has no value."""

    x: Variable
    y: Variable
    output: Variable
    status: Status

    @property
    def height(self) -> float:
        """A suitable height, inches."""
        return 2.6

    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """The map: values (y, x), and its colour bar."""
        values = self.output.values
        missing = ~np.isfinite(values)
        finite = values[~missing]
        # else most of the map would have the colour of one end
        is_steep = bool(
            len(finite) and finite.min() > 0.0 and finite.max() > STEEP * np.median(finite)
        )
        _label_axes(ax, self.x, [self.y], size, grid=False)
        ax.patch.set(**HATCHED)
        mesh = ax.pcolormesh(edges(self.x), edges(self.y), np.ma.masked_invalid(values),
                             cmap=COLORS, norm=norm_of(values, is_steep),
                             rasterized=True)  # fmt: skip
        label_bar(ax.figure.colorbar(mesh, ax=ax, pad=0.02), self.output, size[1])
        if missing.any():
            legend.add(Patch(**HATCHED, label="no value"))
        if missing.sum() <= MARKED_ON_MAP:
            y, x = np.meshgrid(self.y.values, self.x.values, indexing="ij")
            legend.mark(ax, self.status, missing, x, y)
        for spine in ax.spines.values():
            spine.set_visible(True)


def edges(axis: Variable) -> Floats:
    """(n + 1,) edges of the cells about rising values (n,): half way between neighbours."""
    values = np.log(axis.values) if axis.is_log else axis.values
    if len(values) == 1:
        bounds = values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0)
    else:
        middle = 0.5 * (values[1:] + values[:-1])
        first, last = 2.0 * values[0] - middle[0], 2.0 * values[-1] - middle[-1]
        bounds = np.concatenate([[first], middle, [last]])
    return np.asarray(np.exp(bounds) if axis.is_log else bounds)


@attrs.frozen(eq=False)
class Strands(Panel):
    """A curve for each point, or row of points: output (k, m) over (m,), coloured by (k,).

    The status is (k,) of curves over time, (k, m) of curves over a number.
    """

    over: Variable
    output: Variable
    by: Variable
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """The curves and a colour bar; gaps where there is no value."""
        rows, x = self.output.values, self.over.values
        marked = len(x) == 1 or (len(x) <= MARKED and self.status.ndim > 1)
        norm = norm_of(self.by.values, self.by.is_log)
        _label_axes(ax, self.over, [self.output], size)
        lines = LineCollection([np.column_stack([x, row]) for row in rows], cmap=LINE_COLORS,
                               norm=norm, linewidths=1.2 if len(rows) < 25 else 0.8)  # fmt: skip
        lines.set_array(self.by.values)
        ax.add_collection(lines)
        if marked:
            colors = LINE_COLORS(norm(self.by.values))
            for row, color in zip(rows, colors, strict=True):
                ax.plot(x, row, linestyle="", marker="o", markersize=3.0, color=color)
        else:
            ax.set_xlim(x[0], x[-1])
        finite = rows[np.isfinite(rows)]
        if len(finite):  # limits do not follow a collection
            low, high = float(finite.min()), float(finite.max())
            room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
            ax.set_ylim(low - room, high + room)
        label_bar(ax.figure.colorbar(lines, ax=ax, pad=0.02), self.by, size[1])
        if self.status.ndim > 1:
            missing = ~np.isfinite(rows)
            _extend_down(ax, missing)
            legend.mark(ax, self.status, missing, np.broadcast_to(x, rows.shape), None)
        else:
            legend.add_counts(self.status, self.status != DONE)


@attrs.frozen(eq=False)
class Band(Panel):
    """The median of many curves (k, m) over time (m,) and a band that holds most of them.

    Runs that ended early, by their status (k,), are left out where others did not.
    """

    over: Variable
    output: Variable
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """The median, the band, and the extremes as thin lines."""
        done, x = self.status == DONE, self.over.values
        rows = self.output.values[done if done.any() else slice(None)]
        _label_axes(ax, self.over, [self.output], size)
        reached = np.isfinite(rows).any(axis=0)
        rows, x = rows[:, reached], x[reached]
        percentiles = np.nanpercentile(rows, (0.0, BAND[0], 50.0, BAND[1], 100.0), axis=0)
        least, low, middle, high, most = percentiles
        color = style.PALETTE[0]
        band = ax.fill_between(x, low, high, color=color, alpha=0.25, linewidth=0.0,
                               label=f"{BAND[0]:g} to {BAND[1]:g} %")  # fmt: skip
        (line,) = ax.plot(x, middle, color=color, label=f"median of {len(rows)}")
        (thin,) = ax.plot(x, least, color=color, linewidth=0.6, linestyle=":",
                          label="least and greatest")  # fmt: skip
        ax.plot(x, most, color=color, linewidth=0.6, linestyle=":")
        for handle in (line, band, thin):
            legend.add(handle)
        legend.add_counts(self.status, self.status != DONE)


def _label_axes(ax: Axes, x: Variable, outputs: Sequence[Variable], size: tuple[float, float], *,
                grid: bool = True) -> None:  # fmt: skip
    """Set scales, labels, grid, and a legend where a panel has several outputs."""
    width, height = size
    if x.is_log:
        ax.set_xscale("log")
    if outputs[0].is_log:
        ax.set_yscale("log")
    x_label = style.folded(style.with_unit(x.label, x.unit), 13.5 * (width - 0.5))
    labels = list(dict.fromkeys(output.label for output in outputs))
    label = style.with_unit(labels[0] if len(labels) == 1 else "", outputs[0].unit)
    style.style_axes(ax, x_label, style.folded(label, 14 * (height - 0.4)), grid=grid)
    if len(outputs) > 1:
        style.legend_above(ax, [output.name for output in outputs], width)
