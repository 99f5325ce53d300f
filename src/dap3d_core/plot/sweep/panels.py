"""Panels of a picture of a sweep: lines, scattered points, maps, families of curves, bands."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats
from dap3d_core.plot.curves import DASHES, LETTERS, MARKERS, PALETTE, columns_of, shown_text
from dap3d_core.plot.sweep.style import (
    COLORS,
    LINE_COLORS,
    Fates,
    Panel,
    Status,
    fate_of,
    folded,
    name_bar,
    norm_of,
    told,
    with_unit,
)
from dap3d_core.plot.sweep.sweep_table import DONE, Column

#: Of a map, inches.
MAP = 2.6
#: Fewer points of a line are marked each; more on a map have no marks of their own.
MARKED, MARKED_ON_MAP = 60, 400
#: A map whose greatest value is so many times its median has logarithmic colours.
STEEP = 30.0
#: The part of samples that a band holds, in percent.
BAND = 5.0, 95.0


@attrs.frozen(eq=False)
class Lines(Panel):
    """Outputs of one unit over a number; gaps where there is no value."""

    x: Column
    outputs: list[Column]
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """Lines, their points marked."""
        marked = len(self.x.values) <= MARKED
        for k, output in enumerate(self.outputs):
            self._curve(ax, k, output, marked=marked)
        _complete(ax, self, size, fates)

    def _curve(self, ax: Axes, k: int, output: Column, *, marked: bool) -> None:
        alone = _alone(output.values)
        look: dict[str, Any] = dict(color=PALETTE[k % len(PALETTE)], markersize=3.5)
        marker = MARKERS[k % len(MARKERS)]
        ax.plot(self.x.values, output.values, marker=marker if marked else "",
                linestyle=DASHES[k // len(PALETTE) % len(DASHES)], linewidth=1.4,
                label=shown_text(output.name), **look)  # fmt: skip
        if not marked and alone.any():  # a value between two gaps makes no line
            ax.plot(self.x.values[alone], output.values[alone], marker=marker, linestyle="", **look)


def _complete(ax: Axes, panel: "Lines | Scatter", size: tuple[float, float], fates: Fates) -> None:
    """Marks below the curves of points that have no value, and what the axes say."""
    missing = np.any([~np.isfinite(o.values) for o in panel.outputs], axis=0)
    _leave_room(ax, missing)
    seen = missing & np.isfinite(panel.x.values)
    fates.mark(ax, panel.status, seen, panel.x.values, None)
    _frame(ax, panel.x, panel.outputs, size)


def _leave_room(ax: Axes, missing: NDArray[np.bool_]) -> None:
    """Below the curves, for marks, where there are any."""
    if missing.any():
        low, high = ax.get_ylim()
        ax.set_ylim(low - 0.08 * (high - low), high)


def _alone(values: Floats) -> NDArray[np.bool_]:
    there = np.concatenate([[False], np.isfinite(values), [False]])
    return np.asarray(there[1:-1] & ~there[:-2] & ~there[2:])


@attrs.frozen(eq=False)
class Scatter(Panel):
    """Outputs of one unit over a number or an output, a dot for each point."""

    x: Column
    outputs: list[Column]
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """Dots; the more there are, the fainter each is."""
        count = len(self.x.values)
        strength = float(np.clip((300.0 / count) ** 0.5, 0.15, 0.85))
        for k, output in enumerate(self.outputs):
            ax.plot(self.x.values, output.values, marker=MARKERS[k % len(MARKERS)], linestyle="",
                    markersize=3.5 if count < 500 else 2.5, markeredgewidth=0.0, alpha=strength,
                    color=PALETTE[k % len(PALETTE)], label=shown_text(output.name),
                    rasterized=count > 2000)  # fmt: skip
        _complete(ax, self, size, fates)


@attrs.frozen(eq=False)
class Heat(Panel):
    """One output over two numbers, as colours; hatched where it has no value."""

    x: Column
    y: Column
    output: Column
    status: Status

    @property
    def height(self) -> float:
        """That of a map."""
        return MAP

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """The map: values (y, x), and its colour bar."""
        values = self.output.values
        missing = ~np.isfinite(values)
        _frame(ax, self.x, [self.y], size, grid=False)
        ax.patch.set(hatch="////", facecolor="0.96", edgecolor="0.72")
        mesh = ax.pcolormesh(edges(self.x), edges(self.y), np.ma.masked_invalid(values),
                             cmap=COLORS, norm=norm_of(values, _is_steep(values)),
                             rasterized=True)  # fmt: skip
        bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
        name_bar(bar, self.output, size[1])
        if missing.any():
            fates.add(Patch(hatch="////", facecolor="0.96", edgecolor="0.72", label="no value"))
        if missing.sum() <= MARKED_ON_MAP:
            y, x = np.meshgrid(self.y.values, self.x.values, indexing="ij")
            fates.mark(ax, self.status, missing, x, y)
        for spine in ax.spines.values():
            spine.set_visible(True)


def _is_steep(values: Floats) -> bool:
    """Whether one end of a map would have all its colours: these are then of the logarithm."""
    there = values[np.isfinite(values)]
    return bool(len(there) and there.min() > 0.0 and there.max() > STEEP * np.median(there))


def edges(axis: Column) -> Floats:
    """(n + 1,) edges of the cells about rising values (n,): half way between neighbours."""
    values = np.log(axis.values) if axis.is_log else axis.values
    if len(values) == 1:
        values = values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0)
        return np.asarray(np.exp(values) if axis.is_log else values)
    middle = 0.5 * (values[1:] + values[:-1])
    first, last = 2.0 * values[0] - middle[0], 2.0 * values[-1] - middle[-1]
    found = np.concatenate([[first], middle, [last]])
    return np.asarray(np.exp(found) if axis.is_log else found)


@attrs.frozen(eq=False)
class Strands(Panel):
    """A curve for each point, or row of points, coloured by a number.

    Attributes:
        over: what they are drawn over, (m,).
        output: (k, m).
        by: what colours them, (k,).
        status: (k,) of curves over time; (k, m) of curves over a number.
    """

    over: Column
    output: Column
    by: Column
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """The curves and a colour bar; gaps where there is no value."""
        rows, x = self.output.values, self.over.values
        marked = len(x) == 1 or (len(x) <= MARKED and self.status.ndim > 1)
        norm = norm_of(self.by.values, self.by.is_log)
        _frame(ax, self.over, [self.output], size)
        lines = LineCollection([np.column_stack([x, row]) for row in rows], cmap=LINE_COLORS,
                               norm=norm, linewidths=1.2 if len(rows) < 25 else 0.8)  # fmt: skip
        lines.set_array(self.by.values)
        ax.add_collection(lines)
        if marked:
            colors = LINE_COLORS(norm(self.by.values))
            for row, color in zip(rows, colors, strict=True):
                ax.plot(x, row, linestyle="", marker="o", markersize=3.0, color=color)
        _limit(ax, self.over, rows, marked=marked)
        name_bar(ax.figure.colorbar(lines, ax=ax, pad=0.02), self.by, size[1])
        if self.status.ndim > 1:
            over = np.broadcast_to(x, rows.shape)
            _leave_room(ax, ~np.isfinite(rows))
            fates.mark(ax, self.status, ~np.isfinite(rows), over, None)
        else:
            _tell(fates, self.status)


@attrs.frozen(eq=False)
class Band(Panel):
    """The median of many curves and a band that holds most of them, at each instant.

    Attributes:
        over: time, (m,).
        output: (k, m).
        status: (k,); runs that did not go to their end are left out where others did.
    """

    over: Column
    output: Column
    status: Status

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """The median, the band, and the extremes as thin lines."""
        whole, x = self.status == DONE, self.over.values
        rows = self.output.values[whole if whole.any() else slice(None)]
        _frame(ax, self.over, [self.output], size)
        reached = np.isfinite(rows).any(axis=0)
        rows, x = rows[:, reached], x[reached]
        parts = np.nanpercentile(rows, (0.0, BAND[0], 50.0, BAND[1], 100.0), axis=0)
        least, low, middle, high, most = parts
        color = PALETTE[0]
        band = ax.fill_between(x, low, high, color=color, alpha=0.25, linewidth=0.0,
                               label=f"{BAND[0]:g} to {BAND[1]:g} %")  # fmt: skip
        (line,) = ax.plot(x, middle, color=color, label=f"median of {len(rows)}")
        (thin,) = ax.plot(x, least, color=color, linewidth=0.6, linestyle=":",
                          label="least and greatest")  # fmt: skip
        ax.plot(x, most, color=color, linewidth=0.6, linestyle=":")
        for handle in (line, band, thin):
            fates.add(handle)
        _tell(fates, self.status)


def _tell(legend: Fates, status: Status) -> None:
    """Say how many runs did not go to their end."""
    for fate, here in fate_of(status, status != DONE):
        legend.add(Line2D([], [], linestyle="", label=told(fate, here)))


def _frame(
    ax: Axes, x: Column, outputs: Sequence[Column], size: tuple[float, float], *, grid: bool = True
) -> None:
    """Scales, labels, grid, and a legend where several outputs stand in one panel."""
    width, height = size
    if x.is_log:
        ax.set_xscale("log")
    if outputs[0].is_log:
        ax.set_yscale("log")
    ax.set_xlabel(folded(with_unit(x), int(13.5 * (width - 0.5))), fontsize=LETTERS)
    labels = list(dict.fromkeys(output.label for output in outputs))
    words = labels[0] if len(labels) == 1 else ""
    label = with_unit(attrs.evolve(outputs[0], label=words))
    ax.set_ylabel(folded(label, int(14 * (height - 0.4))), fontsize=LETTERS)
    if grid:
        ax.grid(True, alpha=0.3, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    if len(outputs) > 1:
        names = [output.name for output in outputs]
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns_of(names, width - 0.6),
                  fontsize=LETTERS, labelspacing=0.25, frameon=False, borderaxespad=0.2,
                  handlelength=1.8, columnspacing=1.0, handletextpad=0.5)  # fmt: skip


def _limit(ax: Axes, over: Column, rows: Floats, *, marked: bool) -> None:
    """The limits of curves that a collection draws."""
    there = rows[np.isfinite(rows)]
    if len(there):
        low, high = float(there.min()), float(there.max())
        room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        ax.set_ylim(low - room, high + room)
    if not marked:
        ax.set_xlim(over.values[0], over.values[-1])
