"""What pictures of sweeps share: colours of values, marks of points that failed, folded names."""

import re
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
from dap3d_core.plot.curves import LETTERS, columns_of, shown_text, unit_text
from dap3d_core.plot.sweep.sweep_table import DONE, Column
from dap3d_core.study import PointStatus

Status = NDArray[np.int8]

#: Of a panel over one number, inches.
PANEL = 2.1
#: Colours of values, which colour-blind readers can order; of lines without the light end.
COLORS: Colormap = colormaps["viridis"]
LINE_COLORS: Colormap = ListedColormap(COLORS(np.linspace(0.0, 0.88, 256)), name="viridis_lines")
#: How points without a value are marked: the word, the marker, its colour.
FATES = {
    PointStatus.OPEN.value: ("not run so far", "o", "0.55"),
    DONE: ("without a value", "s", "#CC79A7"),
    PointStatus.STOPPED.value: ("stopped early", "^", "#E69F00"),
    PointStatus.FAILED.value: ("failed", "x", "#D55E00"),
}


class Fates:
    """The legend below the panels: what marks stand for, and of how many points."""

    def __init__(self) -> None:
        self._handles: dict[str, Any] = {}

    def add(self, handle: Any) -> None:
        """Add something, once."""
        self._handles.setdefault(str(handle.get_label()), handle)

    def mark(self, ax: Axes, status: Status, missing: NDArray[np.bool_], x: Any, y: Any) -> None:
        """Mark points that have no value at places x, y (n,); y None: above the lower edge."""
        for fate, here in fate_of(status, missing):
            _, marker, color = FATES[fate]
            look: dict[str, Any] = dict(marker=marker, color=color, markersize=4.5, linestyle="",
                                        markerfacecolor="none", markeredgewidth=1.1)  # fmt: skip
            transform = ax.get_xaxis_transform() if y is None else ax.transData
            place = np.full(int(here.sum()), 0.035) if y is None else y[here]
            ax.plot(x[here], place, transform=transform, clip_on=False, zorder=5, **look)
            self.add(Line2D([], [], label=told(fate, here), **look))

    @property
    def handles(self) -> list[Any]:
        """What it has to tell."""
        return list(self._handles.values())

    def legend(self, figure: Figure) -> None:
        """Draw it, where there is anything to tell."""
        handles = self.handles
        if handles:
            labels = [str(handle.get_label()) for handle in handles]
            columns = columns_of(labels, figure.get_figwidth() - 0.2)
            figure.legend(handles=handles, loc="outside lower center", ncols=columns,
                          fontsize=LETTERS, frameon=False, handlelength=1.8,
                          columnspacing=1.0, borderaxespad=0.1)  # fmt: skip


def fate_of(status: Status, missing: NDArray[np.bool_]) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Of the points without a value: how they ended, and which."""
    for fate in FATES:
        here = missing & (status == fate)
        if here.any():
            yield fate, here


def told(fate: int, here: NDArray[np.bool_]) -> str:
    """What the legend says of points that ended so."""
    return f"{FATES[fate][0]} ({int(here.sum())})"


class Panel(ABC):
    """One panel of a figure."""

    @property
    def height(self) -> float:
        """What suits it, inches."""
        return PANEL

    @abstractmethod
    def paint(self, ax: Axes, size: tuple[float, float], fates: Fates) -> None:
        """Draw it.

        Args:
            ax: where.
            size: of the panel, inches.
            fates: the legend of the figure.
        """


def norm_of(values: Floats, is_log: bool = False) -> Normalize:
    """From values to colours; of values that are all equal, the middle."""
    there = values[np.isfinite(values)]
    if not len(there):
        return Normalize(0.0, 1.0)
    low, high = float(there.min()), float(there.max())
    if not high > low:
        room = 0.5 * abs(low) or 1.0
        return Normalize(low - room, high + room)
    return LogNorm(low, high) if is_log else Normalize(low, high)


def name_bar(bar: Any, column: Column, height: float) -> None:
    """The label of a colour bar beside a panel of a height, inches."""
    bar.ax.tick_params(labelsize=LETTERS)
    bar.ax.yaxis.get_offset_text().set_fontsize(LETTERS)
    bar.set_label(folded(with_unit(column), int(13 * (height - 0.6))), fontsize=LETTERS)


def with_unit(column: Column) -> str:
    """What stands at an axis."""
    return shown_text(f"{column.label} {unit_text(column.unit)}" if column.unit else column.label)


def folded(words: str, room: int) -> str:
    """Words on lines of so many characters; names break behind a dot, a colon or an underline."""
    room = max(12, room)
    lines = [""]
    for part in re.findall(r"[^ ._:]*[ ._:]?", words):
        pieces = [part[k : k + room] for k in range(0, len(part), room)]
        for piece in pieces:
            if len((lines[-1] + piece).rstrip()) > room and lines[-1]:
                lines.append("")
            lines[-1] += piece
    return "\n".join(line.strip() for line in lines)


def cut(words: str, room: int) -> str:
    """Words of so many characters at most; their end tells names apart."""
    return words if len(words) <= room else "…" + words[-room + 1 :]
