"""Plots of sweeps: the panels that suit what varies, and their figure."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from dap3d_core.model.groups import Floats
from dap3d_core.plot.style import LETTERS, Picture, folded, shown_text, unit_text, with_unit
from dap3d_core.plot.sweep.panels import (
    LINE_COLORS,
    STATUS_STYLE,
    Band,
    Heat,
    Lines,
    Panel,
    Scatter,
    Status,
    StatusLegend,
    Strands,
    by_status,
    count_label,
    norm_of,
)
from dap3d_core.plot.sweep.sweep_table import TIME, Table, Variable, table_of, unknown

if TYPE_CHECKING:
    import xarray

#: Points that are drawn at most, by what draws them; others are left out evenly.
MOST_ON_LINE, MOST_ON_MAP, MOST_SCATTERED, MOST_PARALLEL = 20_000, 360_000, 20_000, 2_000
#: Curves that colours tell apart; of more the median and a band are drawn, where no axis of a
#: grid orders them. Numbers that a band is made of.
MOST_CURVES, MOST_ORDERED, MOST_IN_BAND = 40, 200, 20_000_000
#: More panels are no picture.
MOST_PANELS = 24

#: Panels, each with the table of the points that it shows.
Panels = list[tuple[Panel, Table]]
#: More lines hide one another: quantiles are drawn in their place, and bars, so many and so high.
MOST_LINES, BARS, BAR_HEIGHT = 200, 30, 0.42
FIFTHS = "medians and middle halves of its fifths; bars: how many points"


@attrs.frozen(eq=False)
class SweepPicture(Picture):
    """Panels of a sweep below one another, and lines of text above them."""

    panels: list[Panel]
    words: tuple[str, ...]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return sum(panel.height for panel in self.panels) + 0.25 + 0.13 * len(self.words)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw all panels on an empty figure; returns their axes, those of colour bars left out."""
        ratios = [panel.height for panel in self.panels]
        grid = figure.subplots(len(ratios), 1, squeeze=False, height_ratios=ratios)
        scale = figure.get_figheight() / sum(ratios)
        axes, legend = list(grid[:, 0]), StatusLegend()
        for k, (ax, panel) in enumerate(zip(axes, self.panels, strict=True)):
            panel.paint(ax, (figure.get_figwidth(), panel.height * scale), legend)
            if k and _share_x(self.panels[k - 1], panel):
                ax.sharex(axes[k - 1])
                axes[k - 1].set_xlabel("")
                axes[k - 1].tick_params(labelbottom=False)
        if self.words:
            room = 14.5 * figure.get_figwidth()
            lines = [folded(shown_text(word), room) for word in self.words]
            figure.suptitle("\n".join(lines), fontsize=LETTERS + (len(lines) == 1))
        legend.draw(figure)
        return axes

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user; a ValueError where there are several panels."""
        if len(self.panels) > 1:
            raise ValueError(f"one axes takes one panel, not {len(self.panels)}: leave ax out")
        box, dpi, legend = ax.get_window_extent(), ax.figure.dpi, StatusLegend()
        self.panels[0].paint(ax, (box.width / dpi, box.height / dpi), legend)
        if legend.handles:
            ax.legend(handles=legend.handles, fontsize="small", framealpha=0.8)
        return ax


def _share_x(above: Panel, below: Panel) -> bool:
    """True where the label of the x axis below the lower panel serves both."""
    return isinstance(above, Lines) and isinstance(below, Lines) and above.x.name == below.x.name


def sweep_picture(
    data: "xarray.Dataset",
    outputs: Sequence[str],
    x: str | None = None,
    at: Mapping[str, float] | None = None,
) -> SweepPicture:
    """Picture of outputs of a sweep.

    Raises:
        UnknownNameError: the sweep has no such output, number or dimension; names the nearest.
        ValueError: this is no sweep, there is nothing to draw, or it cannot be drawn so.
    """
    table = table_of(data, at)
    names = tuple(dict.fromkeys(outputs)) or table.default_outputs(x)
    for name in names:
        table.check(name)
    if not names:
        raise ValueError("the sweep has no outputs: there is nothing to draw")
    _check_values(table, names)
    scalars = [n for n in names if not table.is_series(n)]
    series = [n for n in names if table.is_series(n)]
    if x is not None:
        panels = _over(table, x, scalars, series)
    else:
        panels = _of_points(table, scalars) if scalars else []
        panels += [_over_time(table, name) for name in series]
    if len(panels) > MOST_PANELS:
        raise ValueError(f"{len(panels)} panels are too many; name at most {MOST_PANELS} outputs")
    words = dict.fromkeys(word for _, thin in panels for word in thin.words)
    return SweepPicture([panel for panel, _ in panels], tuple(words))


def _check_values(table: Table, names: Sequence[str]) -> None:
    """Refuse a sweep none of whose points has a value."""
    few = table.thinned(MOST_IN_BAND // max(1, table.data.sizes.get(TIME, 1)))
    if any(np.isfinite(few.output(name).values).any() for name in names):
        return
    counts = np.bincount(few.status.ravel().clip(0, 3), minlength=4)
    words = ("not run so far", "without a value", "stopped", "failed")
    listed = ", ".join(f"{n} {word}" for n, word in zip(counts, words, strict=True) if n)
    raise ValueError(
        f"there is nothing to draw: of {table.size} points none has a value ({listed}); dap3d info "
        "shows why"
    )


def _of_points(table: Table, names: Sequence[str]) -> Panels:
    """Panels of outputs that have one value at each point."""
    if len(table.numbers) == 1:
        most = MOST_SCATTERED if table.sampled else MOST_ON_LINE
        return _panels_by_unit(table.thinned(most), table.numbers[0], names)
    if len(table.numbers) == 2 and not table.sampled:
        thin = table.thinned(MOST_ON_MAP)
        y, x = map(thin.number, thin.numbers)
        return [(Heat(x, y, thin.output(name), thin.status), thin) for name in names]
    thin = table.thinned(MOST_PARALLEL)
    variables = [thin.flat(name) for name in (*thin.numbers, *names)]
    return [(Parallel(variables, len(thin.numbers), thin.status.ravel()), thin)]


def _panels_by_unit(
    thin: Table, x: str, names: Sequence[str], kind: Callable[..., Panel] | None = None
) -> Panels:
    by_unit: dict[str, list[Variable]] = {}
    for name in names:
        output = thin.flat(name)
        by_unit.setdefault(output.unit, []).append(output)
    make: Any = kind or (Scatter if thin.sampled else Lines)
    over, status = thin.flat(x), thin.status.ravel()
    return [(make(over, outputs, status), thin) for outputs in by_unit.values()]


def _over_time(table: Table, name: str) -> tuple[Panel, Table]:
    """The curves of a series: coloured by a number, or of many the median and a band."""
    ordered = not table.sampled and len(table.numbers) == 1
    is_band = table.size > MOST_CURVES and not ordered
    most = MOST_IN_BAND // table.data.sizes[TIME] if is_band else MOST_ORDERED
    thin = table.thinned(most)
    output, status = thin.output(name), thin.status.ravel()
    rows = attrs.evolve(output, values=output.values.reshape(-1, output.values.shape[-1]))
    if is_band:
        return Band(thin.number(TIME), rows, status), thin
    return Strands(thin.number(TIME), rows, thin.flat(thin.numbers[0]), status), thin


def _over(table: Table, x: str, scalars: Sequence[str], series: Sequence[str]) -> Panels:
    """Panels of outputs over a number, or over another output."""
    choices = [*table.numbers, *(n for n in table.outputs if not table.is_series(n))]
    if series:
        raise ValueError(f"{series[0]} is drawn over time: leave x out, or cut it at a time")
    if x not in choices:
        raise unknown("number or output", x, choices)
    if table.sampled or x in table.outputs:
        return _panels_by_unit(table.thinned(MOST_SCATTERED), x, scalars, Scatter)
    if len(table.numbers) == 1:
        return _panels_by_unit(table.thinned(MOST_ON_LINE), x, scalars)
    if len(table.numbers) > 2:
        raise ValueError(
            f"besides {x} there vary {len(table.numbers) - 1} numbers; hold all but one at a value "
            "(at, --at)"
        )
    thin = table.thinned(MOST_ON_MAP)
    axis = table.numbers.index(x)
    over, by = thin.number(x), thin.number(table.numbers[1 - axis])
    status = np.moveaxis(thin.status, axis, 1)
    panels: Panels = []
    for name in scalars:
        output = thin.output(name)
        rows = attrs.evolve(output, values=np.moveaxis(output.values, axis, 1))
        panels.append((Strands(over, rows, by, status), thin))
    return panels


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
