"""Paths of equilibria over a parameter: turning points marked, unstable parts dashed."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.kernels.array_types import Floats
from dap3d_core.plot.style import (
    HEIGHT,
    LETTERS,
    PALETTE,
    PANEL_HEIGHT,
    Picture,
    PlainOffset,
    folded,
    legend_above,
    show_rounding_flat,
    shown_text,
    style_axes,
    with_unit,
)

if TYPE_CHECKING:
    from dap3d_core.study.equilibrium_path import EquilibriumPath

#: Attribute of a path -> label, marker and colour of its special points.
SPECIAL = {
    "turning": ("turning point", "o", PALETTE[1]),
    "branching": ("another path crosses", "D", PALETTE[3]),
}
#: A step is drawn by so many pieces; shorter steps, parts of the range, are at a corner.
BETWEEN, CORNER = 8, 1e-4
#: Legends have the entry of stability where it changes.
STABILITY = ((True, "stable", "-"), (False, "unstable", "--"))


class Panel(NamedTuple):
    """A quantity of a path: its values (k, components), names of the components, label, unit."""

    values: Floats
    names: tuple[str, ...]
    label: str
    unit: str


class EquilibriumPathPicture(Picture):
    """A panel for each quantity, over the parameter."""

    def __init__(self, path: "EquilibriumPath", quantities: Sequence[str]) -> None:
        self.path = path
        self.panels = [_panel(path, name) for name in quantities or [path.largest_motion()]]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT if len(self.panels) == 1 else PANEL_HEIGHT * len(self.panels)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw all panels on an empty figure; returns their axes."""
        axes = figure.subplots(len(self.panels), 1, sharex=True, squeeze=False)[:, 0]
        width, height = figure.get_figwidth(), figure.get_figheight() / len(axes)
        for ax, panel in zip(axes, self.panels, strict=True):
            self._draw_panel(ax, panel, height)
        _, labels = axes[0].get_legend_handles_labels()
        if labels:
            legend_above(axes[0], labels, width)
        for ax in axes[:-1]:
            ax.set_xlabel("")
        return list(axes)

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user; a ValueError where there are several quantities."""
        if len(self.panels) > 1:
            raise ValueError("one axes takes one quantity: leave ax out")
        self._draw_panel(ax, self.panels[0], ax.get_window_extent().height / ax.figure.dpi)
        if ax.get_legend_handles_labels()[1]:
            ax.legend(fontsize=LETTERS, frameon=False)
        return ax

    def _draw_panel(self, ax: Axes, panel: Panel, height: float) -> None:
        path = self.path
        for k, (name, values) in enumerate(zip(panel.names, panel.values.T, strict=True)):
            colour = PALETTE[k % len(PALETTE)]
            fine, x, y = _smooth(path.length, path.values, values)
            for stable, rows in _runs(path):
                dash = next(dash for which, _, dash in STABILITY if which == stable)
                ends = path.length[rows][[0, -1]]
                part = (fine >= ends[0]) & (fine <= ends[1])
                ax.plot(x[part], y[part], dash, color=colour, linewidth=1.4)
            if name:
                ax.plot([], [], color=colour, linewidth=1.4, label=shown_text(name))
        if not (path.stable.all() or not path.stable.any()):
            for _, label, dash in STABILITY:
                ax.plot([], [], dash, color="0.3", linewidth=1.4, label=label)
        for mark, (label, marker, colour) in SPECIAL.items():
            where = getattr(path, mark)
            if where.any():
                x = np.repeat(path.values[where], panel.values.shape[1])
                ax.plot(x, panel.values[where].ravel(), marker, color=colour, linestyle="",
                        markersize=5.0, label=label, zorder=3)  # fmt: skip
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(PlainOffset())
        show_rounding_flat(ax)
        ax.set_xlabel(with_unit(path.parameter, path.unit), fontsize=LETTERS)
        label = with_unit(panel.label, panel.unit)
        ax.set_ylabel(folded(label, 15 * height), fontsize=LETTERS)
        style_axes(ax)


def _panel(path: "EquilibriumPath", name: str) -> Panel:
    quantity = path.quantity(name)
    names = tuple(f"{name}.{c}" for c in quantity.components) or ("",)
    values = quantity.values.reshape(len(path.values), -1)
    return Panel(values, names, quantity.label, quantity.unit)


def _smooth(length: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Points and more between them, on cubic splines over the length from corner to corner."""
    from scipy.interpolate import CubicSpline

    corners = np.flatnonzero(np.diff(length) < CORNER)
    ends = [-1, *corners.tolist(), len(length) - 1]
    pieces = []
    for first, last in pairwise(ends):
        own = slice(first + 1, last + 1)
        known = np.stack([length[own], x[own], y[own]])
        if known.shape[1] > 1:
            parts = np.linspace(0.0, 1.0, BETWEEN, endpoint=False)
            fine = (known[0, :-1, None] + np.diff(known[0])[:, None] * parts).ravel()
            fine = np.append(fine, known[0, -1])
            known = np.vstack([fine, CubicSpline(known[0], known[1:], axis=1)(fine)])
        pieces.append(known)
    whole = np.hstack(pieces)
    return whole[0], whole[1], whole[2]


def _runs(path: "EquilibriumPath") -> Iterator[tuple[bool, slice]]:
    """Rows of one stability after the other; a special point, where it changes, is of both."""
    stable, special = path.stable, path.turning | path.branching
    first = 0
    for end in np.flatnonzero(np.diff(stable.astype(int))).tolist():
        last = end if special[end] else end + 1
        yield bool(stable[end]), slice(first, last + 1)
        first = last
    yield bool(stable[-1]), slice(first, len(stable))
