"""Parallel coordinates of a sweep of many numbers: an axis for each, a line for each point."""

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dap3d_core.model.groups import Floats
from dap3d_core.plot.curves import LETTERS, shown_text, unit_text
from dap3d_core.plot.sweep.style import (
    FATES,
    LINE_COLORS,
    Fates,
    Panel,
    Status,
    cut,
    fate_of,
    folded,
    norm_of,
    told,
    with_unit,
)
from dap3d_core.plot.sweep.sweep_table import Column

#: More lines hide one another: quantiles are drawn in their place, and bars of so many.
MOST_LINES, BARS, HIGHEST = 200, 30, 0.42
FIFTHS = "medians and middle halves of its fifths; bars: how many points"


@attrs.frozen(eq=False)
class Parallel(Panel):
    """Parallel coordinates: an axis for each number and output, a line for each of some points.

    The axes lie below one another, so that long names can be read and many axes fit.

    Attributes:
        columns: (n,) each; numbers first.
        numbers: how many of them are numbers.
        status: (n,).
    """

    columns: list[Column]
    numbers: int
    status: Status

    @property
    def height(self) -> float:
        """So much for each axis."""
        return 0.25 + 0.55 * len(self.columns)

    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """Lines coloured by the first output that has values; points without it are dashed."""
        outputs = self.columns[self.numbers :]
        first = next((o for o in outputs if np.isfinite(o.values).any()), outputs[0])
        scales = [_Scale.of(column) for column in self.columns]
        places = np.stack([s.at(c.values) for s, c in zip(scales, self.columns, strict=True)])
        levels = -np.arange(len(self.columns), dtype=float)
        many = places.shape[1] > MOST_LINES
        there = np.isfinite(first.values)
        for fate, here in fate_of(self.status, ~there):
            color = FATES[fate][2]
            if not many:
                ax.add_collection(_strokes(places[:, here], levels, color, 0.6))
            fates.add(Line2D([], [], color=color, linewidth=1.0, linestyle="--",
                             label=told(fate, here)))  # fmt: skip
        paint = _fifths if many else _lines
        colored = paint(ax, places[:, there], levels, first.values[there])
        ax.set(xlim=(-0.03, 1.03), ylim=(levels[-1] - 0.5, 0.55))
        ax.axis("off")
        for column, scale, level in zip(self.columns, scales, levels, strict=True):
            self._axis(ax, column, scale, level, size[0])
        bar = ax.figure.colorbar(colored, ax=ax, location="bottom", pad=0.0, aspect=40)
        if bar.solids is not None:
            bar.solids.set_alpha(1.0)
        bar.locator = MaxNLocator(max(2, int(1.1 * size[0])))
        bar.update_ticks()
        bar.ax.tick_params(labelsize=LETTERS)
        label = f"{with_unit(first)}; {FIFTHS}" if many else with_unit(first)
        bar.set_label(folded(label, int(17 * size[0])), fontsize=LETTERS)

    def _axis(self, ax: Axes, column: Column, scale: "_Scale", level: float, width: float) -> None:
        ax.plot([0.0, 1.0], [level, level], color="0.2", linewidth=0.9, zorder=4)
        box = {"facecolor": "white", "alpha": 0.85, "pad": 0.6, "linewidth": 0.0}
        room = max(3, int(2.2 * width))
        for value, place in scale.ticks(min(room, 6)):
            ax.plot([place, place], [level, level - 0.07], color="0.2", linewidth=0.9, zorder=4)
            ax.text(place, level - 0.1, f"{value:.4g}", ha="center", va="top", bbox=box, zorder=5,
                    fontsize=LETTERS - 1.0)  # fmt: skip
        words = f"{column.name} {unit_text(column.unit)}" if column.unit else column.name
        ax.text(0.0, level + 0.09, cut(shown_text(words), int(16 * width)), ha="left", va="bottom",
                bbox=box, zorder=5, fontsize=LETTERS)  # fmt: skip


def _lines(ax: Axes, places: Floats, levels: Floats, values: Floats) -> ScalarMappable:
    """A line for each point, coloured by a value (n,)."""
    order = np.argsort(values, kind="stable")
    strength = float(np.clip((120.0 / max(1, len(values))) ** 0.5, 0.2, 0.9))
    lines = _strokes(places[:, order], levels, None, strength)
    lines.set(cmap=LINE_COLORS, norm=norm_of(values))
    lines.set_array(values[order])
    ax.add_collection(lines)
    return lines


def _fifths(ax: Axes, places: Floats, levels: Floats, values: Floats) -> ScalarMappable:
    """Of many points how they are spread along each axis, and quantiles of fifths by a value (n,).

    A line goes through the medians of each fifth, a band holds the middle half of its points.
    """
    colors = ScalarMappable(norm_of(values), LINE_COLORS)
    bounds = np.quantile(values, [0.2, 0.4, 0.6, 0.8])
    fifth = np.searchsorted(bounds, values, side="right")
    for level, row in zip(levels, places, strict=True):
        counts, edges = np.histogram(row[np.isfinite(row)], BARS, (0.0, 1.0))
        ax.bar(edges[:-1], HIGHEST * counts / max(1, counts.max()), 1.0 / BARS, bottom=level,
               align="edge", color="0.82", zorder=1)  # fmt: skip
    for group in np.unique(fifth):
        mine = fifth == group
        color = colors.to_rgba(np.median(values[mine]))
        low, middle, high = np.nanquantile(places[:, mine], [0.25, 0.5, 0.75], axis=1)
        ax.fill_betweenx(levels, low, high, color=color, alpha=0.13, linewidth=0.0, zorder=2)
        ax.plot(middle, levels, color=color, linewidth=1.6, marker="o", markersize=3.0, zorder=3)
    return colors


def _strokes(places: Floats, levels: Floats, color: str | None, strength: float) -> LineCollection:
    """A line through the places (axes, n) of each point; where it has none, it ends."""
    strokes = [np.column_stack([place, levels]) for place in places.T]
    dashes = "-" if color is None else "--"
    width = 0.9 if len(strokes) < 300 else 0.5
    return LineCollection(strokes, colors=color, linewidths=width, alpha=strength,
                          linestyles=dashes, zorder=2)  # fmt: skip


@attrs.frozen
class _Scale:
    """Where values stand along an axis from 0 to 1."""

    low: float
    high: float
    is_log: bool

    @classmethod
    def of(cls, column: Column) -> "_Scale":
        values = column.values[np.isfinite(column.values)]
        if not len(values):
            return cls(np.nan, np.nan, False)
        return cls(float(values.min()), float(values.max()), column.is_log)

    def at(self, values: Floats) -> Floats:
        if not self.high > self.low:
            return np.where(np.isfinite(values), 0.5, np.nan)
        with np.errstate(invalid="ignore"):
            if self.is_log:
                return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))
            return (values - self.low) / (self.high - self.low)

    def ticks(self, most: int) -> list[tuple[float, float]]:
        """Values and places."""
        if not np.isfinite(self.low):
            return []
        if not self.high > self.low:
            return [(self.low, 0.5)]
        if self.is_log:
            values = np.geomspace(self.low, self.high, 3)
        else:
            locator = MaxNLocator(most, steps=[1, 2, 5, 10])
            values = np.asarray(locator.tick_values(self.low, self.high))
            inside = (values >= self.low) & (values <= self.high)
            values = values[inside] if inside.sum() > 1 else np.array([self.low, self.high])
        return list(zip(values.tolist(), self.at(values).tolist(), strict=True))
