"""Pictures of sweeps: which picture fits what varies, and the figure they stand in."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.curves import LETTERS, WIDTH, shown_text
from dap3d_core.plot.sweep.panels import Band, Heat, Lines, Scatter, Strands
from dap3d_core.plot.sweep.parallel_coordinates import Parallel
from dap3d_core.plot.sweep.style import Fates, Panel, folded
from dap3d_core.plot.sweep.sweep_table import TIME, Column, Table, table_of, unknown

if TYPE_CHECKING:
    import xarray

#: Points that are drawn at most, by what draws them; others are left out evenly.
MOST_ON_LINE, MOST_ON_MAP, MOST_SCATTERED, MOST_PARALLEL = 20_000, 360_000, 20_000, 2_000
#: Curves that are told apart by colour; of more the median and a band are drawn, where no axis
#: of a grid orders them. Numbers that a band is made of.
MOST_CURVES, MOST_ORDERED, MOST_IN_BAND = 40, 200, 20_000_000
#: More panels are no picture.
MOST_PANELS = 24


@attrs.frozen(eq=False)
class SweepDrawing:
    """What a figure shows of a sweep.

    Attributes:
        panels: below one another.
        words: above them.
    """

    panels: list[Panel]
    words: tuple[str, ...]

    @property
    def height(self) -> float:
        """A good height, inches."""
        return sum(panel.height for panel in self.panels) + 0.25 + 0.13 * len(self.words)


def gather_sweep(
    data: "xarray.Dataset",
    outputs: Sequence[str],
    x: str | None = None,
    at: Mapping[str, float] | None = None,
) -> SweepDrawing:
    """What a figure of these outputs shows.

    Raises:
        UnknownNameError: the sweep has no such output, number or dimension; names the nearest.
        ValueError: this is no sweep, there is nothing to draw, or it cannot be drawn so.
    """
    table = table_of(data, at)
    names = tuple(dict.fromkeys(outputs)) or table.usual(x)
    for name in names:
        table.check(name)
    if not names:
        raise ValueError("the sweep has no outputs: there is nothing to draw")
    _check_values(table, names)
    scalars = [n for n in names if not table.is_series(n)]
    series = [n for n in names if table.is_series(n)]
    if x is not None:
        found = _over(table, x, scalars, series)
    else:
        found = (_of_points(table, scalars) if scalars else []) + [
            _over_time(table, name) for name in series
        ]
    if len(found) > MOST_PANELS:
        raise ValueError(f"{len(found)} panels are too many; name at most {MOST_PANELS} outputs")
    words = dict.fromkeys(word for _, thin in found for word in thin.words)
    return SweepDrawing([panel for panel, _ in found], tuple(words))


def draw_sweep(figure: Figure, drawing: SweepDrawing) -> list[Axes]:
    """Draw all panels on an empty figure; returns their axes, those of colour bars left out."""
    ratios = [panel.height for panel in drawing.panels]
    grid = figure.subplots(len(ratios), 1, squeeze=False, height_ratios=ratios)
    share = figure.get_figheight() / sum(ratios)
    axes, fates = list(grid[:, 0]), Fates()
    for k, (ax, panel) in enumerate(zip(axes, drawing.panels, strict=True)):
        size = figure.get_figwidth(), panel.height * share
        ax.tick_params(labelsize=LETTERS)
        panel.paint(ax, size, fates)
        if k and _share_x(drawing.panels[k - 1], panel):
            ax.sharex(axes[k - 1])
            axes[k - 1].set_xlabel("")
            axes[k - 1].tick_params(labelbottom=False)
        for offset in (ax.xaxis.get_offset_text(), ax.yaxis.get_offset_text()):
            offset.set_fontsize(LETTERS)
    if drawing.words:
        room = int(14.5 * figure.get_figwidth())
        lines = [folded(shown_text(word), room) for word in drawing.words]
        figure.suptitle("\n".join(lines), fontsize=LETTERS + (len(lines) == 1))
    fates.legend(figure)
    return axes


def _share_x(above: Panel, below: Panel) -> bool:
    """Whether what one panel is drawn over needs to be told below the other alone."""
    plain = Lines, Scatter
    return isinstance(above, plain) and isinstance(below, plain) and above.x.name == below.x.name


def plot_sweep(
    data: "xarray.Dataset",
    outputs: Sequence[str],
    x: str | None,
    at: Mapping[str, float] | None,
    ax: Axes | None,
) -> Axes:
    """What ``plot`` does with a sweep; the axes of the first panel."""
    drawing = gather_sweep(data, outputs, x, at)
    if ax is None:
        from matplotlib import pyplot

        size = (WIDTH, drawing.height)
        figure = pyplot.figure(figsize=size, layout="constrained", dpi=150)
        return draw_sweep(figure, drawing)[0]
    if len(drawing.panels) > 1:
        raise ValueError(f"one axes takes one panel, not {len(drawing.panels)}: leave ax out")
    box, dpi, fates = ax.get_window_extent(), ax.figure.dpi, Fates()
    drawing.panels[0].paint(ax, (box.width / dpi, box.height / dpi), fates)
    if fates.handles:
        ax.legend(handles=fates.handles, fontsize="small", framealpha=0.8)
    return ax


def _check_values(table: Table, names: Sequence[str]) -> None:
    """Refuse a sweep none of whose points has a value."""
    few = table.thinned(MOST_IN_BAND // max(1, table.data.sizes.get(TIME, 1)))
    if any(np.isfinite(few.output(name).values).any() for name in names):
        return
    counts = np.bincount(few.status.ravel().clip(0, 3), minlength=4)
    words = ("not run so far", "without a value", "stopped", "failed")
    told = ", ".join(f"{n} {word}" for n, word in zip(counts, words, strict=True) if n)
    raise ValueError(
        f"there is nothing to draw: of {table.size} points none has a value ({told}); dap3d info "
        "shows why"
    )


Found = list[tuple[Panel, Table]]


def _of_points(table: Table, names: Sequence[str]) -> Found:
    """Panels of outputs that have one value at each point."""
    if len(table.numbers) == 1:
        most = MOST_SCATTERED if table.sampled else MOST_ON_LINE
        return _panels_by_unit(table.thinned(most), table.numbers[0], names)
    if len(table.numbers) == 2 and not table.sampled:
        thin = table.thinned(MOST_ON_MAP)
        y, x = map(thin.number, thin.numbers)
        return [(Heat(x, y, thin.output(name), thin.status), thin) for name in names]
    thin = table.thinned(MOST_PARALLEL)
    columns = [thin.flat(name) for name in (*thin.numbers, *names)]
    panel = Parallel(columns, len(thin.numbers), thin.status.ravel())
    return [(panel, thin)]


def _panels_by_unit(
    thin: Table, x: str, names: Sequence[str], kind: Callable[..., Panel] | None = None
) -> Found:
    by_unit: dict[str, list[Column]] = {}
    for name in names:
        column = thin.flat(name)
        by_unit.setdefault(column.unit, []).append(column)
    make: Any = kind or (Scatter if thin.sampled else Lines)
    over, status = thin.flat(x), thin.status.ravel()
    return [(make(over, columns, status), thin) for columns in by_unit.values()]


def _over_time(table: Table, name: str) -> tuple[Panel, Table]:
    """The curves of a series: coloured by a number, or of many the median and a band."""
    ordered = not table.sampled and len(table.numbers) == 1
    if table.size > MOST_CURVES and not ordered:
        thin = table.thinned(MOST_IN_BAND // table.data.sizes[TIME])
        return Band(thin.number(TIME), _rows(thin.output(name)), thin.status.ravel()), thin
    thin = table.thinned(MOST_ORDERED)
    by = thin.flat(thin.numbers[0])
    return Strands(thin.number(TIME), _rows(thin.output(name)), by, thin.status.ravel()), thin


def _rows(column: Column) -> Column:
    """An output of each point as a row."""
    return attrs.evolve(column, values=column.values.reshape(-1, column.values.shape[-1]))


def _over(table: Table, x: str, scalars: Sequence[str], series: Sequence[str]) -> Found:
    """Panels of outputs over a number, or over another output."""
    choices = [*table.numbers, *(n for n in table.outputs if not table.is_series(n))]
    if series:
        raise ValueError(f"{series[0]} is drawn over time: leave x out, or cut it at a time")
    if x not in choices:
        raise unknown("number or output", x, choices)
    if table.sampled or x in table.outputs:
        thin = table.thinned(MOST_SCATTERED)
        return _panels_by_unit(thin, x, scalars, Scatter)
    if len(table.numbers) == 1:
        return _panels_by_unit(table.thinned(MOST_ON_LINE), x, scalars)
    if len(table.numbers) > 2:
        raise ValueError(
            f"besides {x} there vary {len(table.numbers) - 1} numbers; hold all but one at a value "
            "(at, --at)"
        )
    thin = table.thinned(MOST_ON_MAP)
    place = table.numbers.index(x)
    over, by = thin.number(x), thin.number(table.numbers[1 - place])
    found: Found = []
    for name in scalars:
        output = thin.output(name)
        rows = attrs.evolve(output, values=np.moveaxis(output.values, place, 1))
        status = np.moveaxis(thin.status, place, 1)
        found.append((Strands(over, rows, by, status), thin))
    return found
