"""Curves over time, or over one another, of one run or several: one panel for each unit."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.model.groups import Floats
from dap3d_core.plot.energies import drift_of, span_of
from dap3d_core.plot.style import (
    DASHES,
    HEIGHT,
    LETTERS,
    MARKERS,
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
from dap3d_core.result import Quantity, Result, UnknownNameError, find
from dap3d_core.result.post.smooth_parts import cubic, smooth_parts

#: A curve of fewer instants is drawn through about so many points.
POINTS = 600


def _refined(t: Floats, x: Floats, x_dot: Floats) -> Floats:
    """A curve x (nt,) with derivative x_dot, at its instants and at equal fractions between.

    A derivative that is NaN is taken for that of the straight line between two instants.
    """
    if not 1 < len(t) < POINTS:
        return x
    between = -(-POINTS // len(t))
    h, ends, rates = np.diff(t), np.stack([x[:-1], x[1:]]), np.stack([x_dot[:-1], x_dot[1:]])
    rates = np.where(np.isnan(rates), np.diff(x) / h, rates)
    pieces = [cubic(k / between, h, ends, rates) for k in range(between)]
    return np.append(np.stack(pieces, axis=1).reshape(-1), x[-1])


def smooth(t: Floats, x: Floats, y: Floats, x_dot: Floats | None, y_dot: Floats | None
           ) -> tuple[Floats, Floats]:  # fmt: skip
    """A curve (x, y), between instants t by cubics where both derivatives are known."""
    if x_dot is None or y_dot is None:
        return x, y
    return _refined(t, x, x_dot), _refined(t, y, y_dot)


def rate_of(result: Result, quantity: Quantity) -> Floats | None:
    """The derivative of a quantity in time, None where it is not known."""
    if quantity.name == "t":
        return np.ones(len(result.t))
    return find(result, quantity.rate).values if quantity.rate else None


class Curve(NamedTuple):
    """One line: its name in the legend, its points, the quantity, the number of its run.

    ``drift`` are words on the drift of a conserved energy; the axis spans ``span`` or more.
    """

    name: str
    points: tuple[Floats, Floats]
    quantity: Quantity
    run: int
    drift: str = ""
    span: float = 0.0


@attrs.frozen(eq=False)
class CurvePicture(Picture):
    """Panels of curves over one quantity: unit -> curves; a title above them."""

    x: Quantity
    panels: dict[str, list[Curve]]
    title: str

    @property
    def is_path(self) -> bool:
        """True for the path of a point, both of whose axes have one scale."""
        return self.x.name != "t" and list(self.panels) == [self.x.unit]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT if len(self.panels) == 1 else PANEL_HEIGHT * len(self.panels)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw all panels on an empty figure; returns their axes."""
        axes = figure.subplots(len(self.panels), 1, sharex=True, squeeze=False)[:, 0]
        width, height = figure.get_figwidth(), figure.get_figheight() / len(axes)
        for ax, (unit, curves) in zip(axes, self.panels.items(), strict=True):
            self._draw_panel(ax, unit, curves, height)
            if len(curves) > 1:
                legend_above(ax, [curve.name + curve.drift for curve in curves], width)
            style_axes(ax)
        label = with_unit(self.x.label, self.x.unit)
        axes[-1].set_xlabel(folded(label, 17 * width), fontsize=LETTERS)
        if self.is_path:
            axes[0].set_aspect("equal", adjustable="datalim")
        if self.title:
            figure.suptitle(shown_text(self.title), fontsize=LETTERS + 1)
        return list(axes)

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user; a ValueError where the curves have several units."""
        if len(self.panels) > 1:
            raise ValueError(
                f"one axes takes one unit; these quantities have {', '.join(self.panels)}: leave "
                "ax out"
            )
        ((unit, curves),) = self.panels.items()
        self._draw_panel(ax, unit, curves, ax.get_window_extent().height / ax.figure.dpi)
        if len(curves) > 1:
            ax.legend(fontsize="small", framealpha=0.8)
        ax.set_xlabel(with_unit(self.x.label, self.x.unit))
        return ax

    def _draw_panel(self, ax: Axes, unit: str, curves: Sequence[Curve], height: float) -> None:
        """Draw the curves of one unit in a panel of a height (inches).

        Colours differ from curve to curve, dashes from run to run: curves that lie on one another
        are still seen. A circle marks the start of a path.
        """
        several = len({curve.run for curve in curves}) > 1
        for k, curve in enumerate(curves):
            single = len(curve.quantity.values) == 1
            dash = curve.run if several else k // len(PALETTE)
            start = "o" if self.x.name != "t" else ""
            ax.plot(
                *curve.points,
                color=PALETTE[k % len(PALETTE)],
                linestyle="none" if single else DASHES[dash % len(DASHES)],
                marker=MARKERS[k % len(MARKERS)] if single else start,
                markevery=[0],
                markersize=4.5,
                markerfacecolor="none",
                linewidth=1.4,
                label=shown_text(curve.name + (curve.drift if len(curves) > 1 else "")),
            )
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(PlainOffset())
        show_rounding_flat(ax, max(curve.span for curve in curves))
        ax.set_ylabel(folded(_y_label(unit, curves), 15 * height), fontsize=LETTERS)


def _y_label(unit: str, curves: Sequence[Curve]) -> str:
    labels = list(dict.fromkeys(c.quantity.label for c in curves))
    kinds = list(dict.fromkeys(c.quantity.kind for c in curves))
    words = labels[0] if len(labels) == 1 else ", ".join(kinds) if len(kinds) < 3 else ""
    return with_unit(words + (curves[0].drift if len(curves) == 1 else ""), unit)


def curve_picture(
    result: Result | Mapping[str, Result], quantities: Sequence[str], x: str | None
) -> CurvePicture:
    """Picture of quantities of one result or of several by name; errors as ``plot``."""
    runs = result if isinstance(result, Mapping) else {"": result}
    if not runs:
        raise ValueError("there are no runs to draw")
    if not quantities:
        raise ValueError("name at least one quantity, such as energy.total or BODY.r")
    panels: dict[str, list[Curve]] = {}
    drawn = {name: _quantities(run, quantities, x, name) for name, run in runs.items()}
    for k in range(len(set(quantities))):
        for number, (name, (over, of_run)) in enumerate(drawn.items()):
            quantity = of_run[k]
            unit = quantity.unit
            alone = quantity.values.ndim == 1 and [q.unit for q in of_run].count(unit) == 1
            curves = _curves(runs[name], over, quantity, number, name, alone=alone)
            panels.setdefault(unit, []).extend(curves)
    titles = list(dict.fromkeys(_title_of(run) for run in runs.values()))
    over = next(iter(drawn.values()))[0]
    return CurvePicture(over, panels, titles[0] if len(titles) == 1 else "")


def _quantities(
    result: Result, names: Sequence[str], x: str | None, run: str
) -> tuple[Quantity, list[Quantity]]:
    """The quantity on the x axis of a run, and the quantities of its curves."""
    if not len(result.t):
        raise ValueError(f"the result {run} has no instants: there is nothing to draw")
    try:
        over = find(result, x or "t")
        quantities = [find(result, name) for name in dict.fromkeys(names)]
    except UnknownNameError as error:
        if not run:
            raise
        raise UnknownNameError(f"{run}: {error}") from error
    if over.values.ndim > 1:
        choices = ", ".join(f"{over.name}.{c}" for c in over.components)
        raise ValueError(f"x = {over.name} has components; name one of {choices}")
    return over, quantities


def _title_of(result: Result) -> str:
    title = result.record.title
    return f"{title} ({result.status})" if title and result.status != "done" else title


def _curves(
    result: Result, over: Quantity, quantity: Quantity, number: int, run: str, *, alone: bool
) -> Iterable[Curve]:
    """The curves of a quantity of a run; ``alone`` in its panel, it has the name of its run."""
    names = [f"{quantity.name}.{c}" for c in quantity.components] or [quantity.name]
    parts = smooth_parts(result)
    of_parts = [
        _points(part, over, quantity)
        if part is result
        else _points(part, find(part, over.name), find(part, quantity.name))
        for part in parts
    ]
    for name, *points in zip(names, *of_parts, strict=True):
        label = run if alone and run else ", ".join(part for part in (name, run) if part)
        drift, span = drift_of(result, quantity), span_of(result, quantity)
        yield Curve(label, _interrupted(points), quantity, number, drift, span)


def _points(result: Result, over: Quantity, quantity: Quantity) -> list[tuple[Floats, Floats]]:
    """The curve of each component of a quantity."""
    columns = quantity.values.reshape(len(result.t), -1).T
    over_rate, rate = rate_of(result, over), rate_of(result, quantity)
    rates = [None] * len(columns) if rate is None else rate.reshape(len(result.t), -1).T
    return [smooth(result.t, over.values, values, over_rate, own)
            for values, own in zip(columns, rates, strict=True)]  # fmt: skip


def _interrupted(parts: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Curves one behind the other, with a gap between two."""
    if len(parts) == 1:
        return parts[0]
    gap = np.full(1, np.nan)
    x, y = (np.concatenate([z for part in axis for z in (part, gap)][:-1])
            for axis in zip(*parts, strict=True))  # fmt: skip
    return x, y
