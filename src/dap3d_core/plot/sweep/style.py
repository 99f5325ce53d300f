"""Style of plots of sweeps: colours of values, marks of points without a value, colour bars."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats
from dap3d_core.plot.style import LETTERS, PANEL_HEIGHT, columns_of, folded, legend_below, with_unit
from dap3d_core.plot.sweep.sweep_table import DONE, Variable
from dap3d_core.study import PointStatus

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
            style: dict[str, Any] = dict(marker=marker, color=color, markersize=4.5, linestyle="",
                                         markerfacecolor="none", markeredgewidth=1.1)  # fmt: skip
            transform = ax.get_xaxis_transform() if y is None else ax.transData
            height = np.full(int(here.sum()), 0.035) if y is None else y[here]
            ax.plot(x[here], height, transform=transform, clip_on=False, zorder=5, **style)
            self.add(Line2D([], [], label=count_label(code, here), **style))

    @property
    def handles(self) -> list[Any]:
        """The handles, each with its label."""
        return list(self._handles.values())

    def draw(self, figure: Figure) -> None:
        """Draw the legend, where it has any entry."""
        if self._handles:
            columns = columns_of(list(self._handles), figure.get_figwidth() - 0.2)
            legend_below(figure, self.handles, columns)


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
        return PANEL_HEIGHT

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
    bar.ax.tick_params(labelsize=LETTERS)
    bar.ax.yaxis.get_offset_text().set_fontsize(LETTERS)
    label = with_unit(variable.label, variable.unit)
    bar.set_label(folded(label, 13 * (height - 0.6)), fontsize=LETTERS)
