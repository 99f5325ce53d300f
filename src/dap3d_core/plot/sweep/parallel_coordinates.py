"""Parallel coordinates of a sweep of many numbers: an axis for each, a line for each point."""

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dap3d_core.model.groups import Floats
from dap3d_core.plot.style import LETTERS, folded, shown_text, unit_text, with_unit
from dap3d_core.plot.sweep.style import (
    LINE_COLORS,
    STATUS_STYLE,
    Panel,
    Status,
    StatusLegend,
    by_status,
    count_label,
    norm_of,
)
from dap3d_core.plot.sweep.sweep_table import Variable

#: More lines hide one another: quantiles are drawn in their place, and bars, so many and so high.
MOST_LINES, BARS, BAR_HEIGHT = 200, 30, 0.42
FIFTHS = "medians and middle halves of its fifths; bars: how many points"


@attrs.frozen(eq=False)
class Parallel(Panel):
    """Parallel coordinates: axes below one another, so that long names can be read.

    Attributes:
        variables: (n,) each; numbers first.
        number_count: how many of them are numbers, not outputs.
        status: (n,).
    """

    variables: list[Variable]
    number_count: int
    status: Status

    @property
    def height(self) -> float:
        """A suitable height, inches."""
        return 0.25 + 0.55 * len(self.variables)

    def paint(self, ax: Axes, size: tuple[float, float], legend: StatusLegend) -> None:
        """Lines coloured by the first output that has values; points without it are dashed."""
        outputs = self.variables[self.number_count :]
        first = next((o for o in outputs if np.isfinite(o.values).any()), outputs[0])
        scales = [_Scale.of(variable) for variable in self.variables]
        at = np.stack([s.at(v.values) for s, v in zip(scales, self.variables, strict=True)])
        levels = -np.arange(len(self.variables), dtype=float)
        many = at.shape[1] > MOST_LINES
        finite = np.isfinite(first.values)
        for code, here in by_status(self.status, ~finite):
            color = STATUS_STYLE[code][2]
            if not many:
                ax.add_collection(_strokes(at[:, here], levels, color, 0.6))
            legend.add(Line2D([], [], color=color, linewidth=1.0, linestyle="--",
                              label=count_label(code, here)))  # fmt: skip
        draw = _draw_fifths if many else _draw_lines
        colored = draw(ax, at[:, finite], levels, first.values[finite])
        ax.set(xlim=(-0.03, 1.03), ylim=(levels[-1] - 0.5, 0.55))
        ax.axis("off")
        for variable, scale, level in zip(self.variables, scales, levels, strict=True):
            _draw_axis(ax, variable, scale, level, size[0])
        bar = ax.figure.colorbar(colored, ax=ax, location="bottom", pad=0.0, aspect=40)
        if bar.solids is not None:
            bar.solids.set_alpha(1.0)
        bar.locator = MaxNLocator(max(2, int(1.1 * size[0])))
        bar.update_ticks()
        bar.ax.tick_params(labelsize=LETTERS)
        label = with_unit(first.label, first.unit) + (f"; {FIFTHS}" if many else "")
        bar.set_label(folded(label, 17 * size[0]), fontsize=LETTERS)


def _draw_axis(ax: Axes, variable: Variable, scale: "_Scale", level: float, width: float) -> None:
    """An axis with ticks and the name of its variable, in a panel of a width, inches."""
    ax.plot([0.0, 1.0], [level, level], color="0.2", linewidth=0.9, zorder=4)
    box = {"facecolor": "white", "alpha": 0.85, "pad": 0.6, "linewidth": 0.0}
    for value, at in scale.ticks(min(max(3, int(2.2 * width)), 6)):
        ax.plot([at, at], [level, level - 0.07], color="0.2", linewidth=0.9, zorder=4)
        ax.text(at, level - 0.1, f"{value:.4g}", ha="center", va="top", bbox=box, zorder=5,
                fontsize=LETTERS - 1.0)  # fmt: skip
    room = int(16 * width)
    text = shown_text(f"{variable.name} {unit_text(variable.unit)}".rstrip())
    if len(text) > room:
        text = "…" + text[-room + 1 :]  # their end tells names apart
    ax.text(0.0, level + 0.09, text, ha="left", va="bottom", bbox=box, zorder=5, fontsize=LETTERS)


def _draw_lines(ax: Axes, at: Floats, levels: Floats, values: Floats) -> ScalarMappable:
    """A line for each point, coloured by a value (n,)."""
    order = np.argsort(values, kind="stable")
    alpha = float(np.clip((120.0 / max(1, len(values))) ** 0.5, 0.2, 0.9))
    lines = _strokes(at[:, order], levels, None, alpha)
    lines.set(cmap=LINE_COLORS, norm=norm_of(values))
    lines.set_array(values[order])
    ax.add_collection(lines)
    return lines


def _draw_fifths(ax: Axes, at: Floats, levels: Floats, values: Floats) -> ScalarMappable:
    """Histograms along each axis, and quantiles of fifths of the points by a value (n,).

    A line goes through the medians of each fifth, a band holds the middle half of its points.
    """
    colors = ScalarMappable(norm_of(values), LINE_COLORS)
    bounds = np.quantile(values, [0.2, 0.4, 0.6, 0.8])
    fifth = np.searchsorted(bounds, values, side="right")
    for level, row in zip(levels, at, strict=True):
        counts, edges = np.histogram(row[np.isfinite(row)], BARS, (0.0, 1.0))
        ax.bar(edges[:-1], BAR_HEIGHT * counts / max(1, counts.max()), 1.0 / BARS, bottom=level,
               align="edge", color="0.82", zorder=1)  # fmt: skip
    for group in np.unique(fifth):
        members = fifth == group
        color = colors.to_rgba(np.median(values[members]))
        low, middle, high = np.nanquantile(at[:, members], [0.25, 0.5, 0.75], axis=1)
        ax.fill_betweenx(levels, low, high, color=color, alpha=0.13, linewidth=0.0, zorder=2)
        ax.plot(middle, levels, color=color, linewidth=1.6, marker="o", markersize=3.0, zorder=3)
    return colors


def _strokes(at: Floats, levels: Floats, color: str | None, alpha: float) -> LineCollection:
    """A line through the coordinates (axes, n) of each point; it ends where there is none."""
    strokes = [np.column_stack([column, levels]) for column in at.T]
    dashes = "-" if color is None else "--"
    width = 0.9 if len(strokes) < 300 else 0.5
    return LineCollection(strokes, colors=color, linewidths=width, alpha=alpha,
                          linestyles=dashes, zorder=2)  # fmt: skip


@attrs.frozen
class _Scale:
    """Map from values to an axis from 0 to 1."""

    low: float
    high: float
    is_log: bool

    @classmethod
    def of(cls, variable: Variable) -> "_Scale":
        values = variable.values[np.isfinite(variable.values)]
        if not len(values):
            return cls(np.nan, np.nan, False)
        return cls(float(values.min()), float(values.max()), variable.is_log)

    def at(self, values: Floats) -> Floats:
        if not self.high > self.low:
            return np.where(np.isfinite(values), 0.5, np.nan)
        with np.errstate(invalid="ignore"):
            if self.is_log:
                return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))
            return (values - self.low) / (self.high - self.low)

    def ticks(self, most: int) -> list[tuple[float, float]]:
        """Values of ticks and where they are on the axis."""
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
