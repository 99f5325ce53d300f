"""Curves over time, or over one another, of one run or several: one panel for each unit."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.model.groups import Floats
from dap3d_core.plot.cubics import cubics
from dap3d_core.plot.ticks import PlainOffset, show_rounding_flat
from dap3d_core.result import Quantity, Result, UnknownNameError, find

if TYPE_CHECKING:
    import xarray

    from dap3d_core.study.fit.fit_result import Fit

#: Colours that colour-blind readers can tell apart, on white (Okabe and Ito 2008, without yellow).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Further curves repeat the colours with other dashes.
DASHES = ("-", "--", "-.", ":")
#: A single instant is drawn as markers, which may lie over one another.
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
#: Inches. Letters of 8 points are still 5 points high where the picture is set 60 mm wide.
WIDTH, HEIGHT, PANEL_HEIGHT = 3.8, 2.9, 2.1
LETTERS = 8.0


class Curve(NamedTuple):
    """One line.

    Attributes:
        name: in the legend.
        t: (nt,) reported instants, s.
        x, values: (nt,) where it runs.
        x_rate, rate: (nt,) their derivatives in time, None where they are not known.
        quantity, run: whose it is.
    """

    name: str
    t: Floats
    x: Floats
    values: Floats
    x_rate: Floats | None
    rate: Floats | None
    quantity: Quantity
    run: int

    @property
    def smooth(self) -> tuple[Floats, Floats]:
        """Places and values, between instants by cubics where both rates are known."""
        if self.x_rate is None or self.rate is None:
            return self.x, self.values
        return cubics(self.t, self.x, self.x_rate), cubics(self.t, self.values, self.rate)


class Panel(NamedTuple):
    """The curves of one unit."""

    unit: str
    curves: list[Curve]


class Drawing(NamedTuple):
    """What a figure shows: panels over one quantity, and words above them."""

    x: Quantity
    panels: list[Panel]
    title: str

    @property
    def is_path(self) -> bool:
        """Whether a point's path is shown, whose two axes have one scale."""
        return self.x.name != "t" and [p.unit for p in self.panels] == [self.x.unit]


def plot(
    result: "Result | Mapping[str, Result] | Fit | xarray.Dataset",
    *quantities: str,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw quantities of a result, or outputs of a sweep, in panels below one another.

    Args:
        result: a ``Result``; several as names and results, {"rtol 1e-6": result, ...}; a ``Fit``:
            its data, its curves and its residuals; or the data set of a sweep.
        quantities: names such as ``crank.r.z``, ``crank.w`` (all components), ``energy.total``;
            those of different units stand in panels of their own. Of a fit its outputs, all when
            left out. Of a sweep as well: lines over one number, a map over two, parallel
            coordinates over more, curves over time (docs/how-to/look-at-sweeps.md).
        x: the quantity they are drawn over, one number an instant; time when left out. A path, a
            length over a length, has one scale on both axes; a circle marks its start. Of a sweep a
            number or an output.
        at: of a sweep: number -> value; the points nearest to it alone are drawn.
        ax: where to draw; a new pyplot figure when left out.

    Returns:
        The axes, of the first panel where there are several (``ax.figure.axes`` has all).
        ``matplotlib.pyplot.show()`` shows them. A result of one instant is drawn as markers.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ValueError: no runs, no quantities, no instants, ``x`` has components, or ``ax`` is to take
            several units; a sweep without values, or a data set that is no sweep.
    """
    if hasattr(result, "data_vars"):  # a data set of xarray, which is a mapping as well
        from dap3d_core.plot.sweep.sweep_plot import plot_sweep

        return plot_sweep(cast("xarray.Dataset", result), quantities, x, at, ax)
    if at:
        raise ValueError("at chooses points of a sweep; this is none")
    if not isinstance(result, (Result, Mapping)):
        if x is not None or ax is not None:
            raise ValueError("a fit is drawn over time, on a figure of its own: leave x, ax out")
        from dap3d_core.plot.fit import plot_fit

        return plot_fit(result, quantities)
    runs = cast("Result | Mapping[str, Result]", result)
    drawing = gather(runs, quantities, x)
    if ax is None:
        from matplotlib import pyplot

        size = (WIDTH, height_of(drawing))
        return draw(pyplot.figure(figsize=size, layout="constrained", dpi=150), drawing)[0]
    if len(drawing.panels) > 1:
        units = ", ".join(p.unit for p in drawing.panels)
        raise ValueError(f"one axes takes one unit; these quantities have {units}: leave ax out")
    draw_panel(ax, drawing, drawing.panels[0], ax.get_window_extent().height / ax.figure.dpi)
    if len(drawing.panels[0].curves) > 1:
        ax.legend(fontsize="small", framealpha=0.8)
    ax.set_xlabel(with_unit(drawing.x.label, drawing.x.unit))
    return ax


def gather(
    result: Result | Mapping[str, Result], quantities: Sequence[str], x: str | None
) -> Drawing:
    """What a figure of these quantities shows; errors as ``plot``."""
    runs = result if isinstance(result, Mapping) else {"": result}
    if not runs:
        raise ValueError("there are no runs to draw")
    if not quantities:
        raise ValueError("name at least one quantity, such as energy.total or BODY.r")
    panels: dict[str, Panel] = {}
    found = {name: _of_run(run, quantities, x, name) for name, run in runs.items()}
    over = next(iter(found.values()))[0]
    for k in range(len(set(quantities))):
        for number, (name, (along, there)) in enumerate(found.items()):
            unit = there[k].unit
            alone = there[k].values.ndim == 1 and [q.unit for q in there].count(unit) == 1
            curves = panels.setdefault(unit, Panel(unit, [])).curves
            curves.extend(_curves(runs[name], along, there[k], number, name, alone=alone))
    titles = list(dict.fromkeys(_title_of(run) for run in runs.values()))
    return Drawing(over, list(panels.values()), titles[0] if len(titles) == 1 else "")


def _of_run(
    result: Result, names: Sequence[str], x: str | None, run: str
) -> tuple[Quantity, list[Quantity]]:
    """What the curves of a run are drawn over, and they themselves."""
    if not len(result.t):
        raise ValueError(f"the result {run} has no instants: there is nothing to draw")
    try:
        over = find(result, x or "t")
        found = [find(result, name) for name in dict.fromkeys(names)]
    except UnknownNameError as error:
        if not run:
            raise
        raise UnknownNameError(f"{run}: {error}") from error
    if over.values.ndim > 1:
        choices = ", ".join(f"{over.name}.{c}" for c in over.components)
        raise ValueError(f"x = {over.name} has components; name one of {choices}")
    return over, found


def _title_of(result: Result) -> str:
    title = result.record.title
    return f"{title} ({result.status})" if title and result.status != "done" else title


def _curves(
    result: Result, over: Quantity, quantity: Quantity, number: int, run: str, *, alone: bool
) -> Iterable[Curve]:
    """The curves of a quantity of a run; ``alone`` in its panel, it is named by its run."""
    names = [f"{quantity.name}.{c}" for c in quantity.components] or [quantity.name]
    columns = quantity.values.reshape(len(result.t), -1).T
    x_rate, rate = _rate(result, over), _rate(result, quantity)
    rates = [None] * len(columns) if rate is None else rate.reshape(len(result.t), -1).T
    for name, values, own in zip(names, columns, rates, strict=True):
        words = run if alone and run else ", ".join(word for word in (name, run) if word)
        yield Curve(words, result.t, over.values, values, x_rate, own, quantity, number)


def smooth(result: Result, quantity: Quantity) -> tuple[Floats, Floats]:
    """Times and values of one number, between instants by cubics where its rate is known."""
    rate = _rate(result, quantity)
    if rate is None:
        return result.t, quantity.values
    ones = np.ones(len(result.t))
    return cubics(result.t, result.t, ones), cubics(result.t, quantity.values, rate)


def _rate(result: Result, quantity: Quantity) -> Floats | None:
    """The derivative of a quantity in time, None where it is not known."""
    if quantity.name == "t":
        return np.ones(len(result.t))
    return find(result, quantity.rate).values if quantity.rate else None


def height_of(drawing: Drawing) -> float:
    """A good height for a figure, inches."""
    count = len(drawing.panels)
    return HEIGHT if count == 1 else PANEL_HEIGHT * count


def draw(figure: Figure, drawing: Drawing) -> list[Axes]:
    """Draw all panels on an empty figure; returns their axes."""
    axes = figure.subplots(len(drawing.panels), 1, sharex=True, squeeze=False)[:, 0]
    width, height = figure.get_figwidth(), figure.get_figheight() / len(axes)
    for ax, panel in zip(axes, drawing.panels, strict=True):
        draw_panel(ax, drawing, panel, height)
        if len(panel.curves) > 1:
            _add_legend(ax, panel, width)
        ax.grid(True, alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=LETTERS)
        for offset in (ax.xaxis.get_offset_text(), ax.yaxis.get_offset_text()):
            offset.set_fontsize(LETTERS)
    axes[-1].set_xlabel(
        wrapped(with_unit(drawing.x.label, drawing.x.unit), 17 * width), fontsize=LETTERS
    )
    if drawing.is_path:
        axes[0].set_aspect("equal", adjustable="datalim")
    if drawing.title:
        figure.suptitle(shown_text(drawing.title), fontsize=LETTERS + 1)
    return list(axes)


def draw_panel(ax: Axes, drawing: Drawing, panel: Panel, height: float) -> None:
    """Draw the curves of one unit, with their axis label.

    Colours differ from curve to curve, dashes from run to run: curves that lie on one another
    are still seen.

    Args:
        ax: where.
        drawing: what the curves are drawn over.
        panel: the curves.
        height: of the panel, inches.
    """
    several = len({curve.run for curve in panel.curves}) > 1
    for k, curve in enumerate(panel.curves):
        single = len(curve.t) == 1
        dash = curve.run if several else k // len(PALETTE)
        ax.plot(
            *curve.smooth,
            color=PALETTE[k % len(PALETTE)],
            linestyle="none" if single else DASHES[dash % len(DASHES)],
            marker=MARKERS[k % len(MARKERS)] if single else "o" if drawing.x.name != "t" else "",
            markevery=[0],
            markersize=4.5,
            markerfacecolor="none",
            linewidth=1.4,
            label=shown_text(curve.name),
        )
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(PlainOffset())
    show_rounding_flat(ax)
    ax.set_ylabel(wrapped(_y_label(panel), 15 * height), fontsize=LETTERS)


def wrapped(words: str, room: float) -> str:
    """Words on lines of so many characters beside an axis."""
    return "\n".join(textwrap.wrap(words, max(14, int(room))))


def _y_label(panel: Panel) -> str:
    if len(panel.curves) == 1:
        return with_unit(panel.curves[0].quantity.label, panel.unit)
    whole = list(dict.fromkeys(c.quantity.label for c in panel.curves))
    kinds = list(dict.fromkeys(c.quantity.kind for c in panel.curves))
    words = whole[0] if len(whole) == 1 else ", ".join(kinds) if len(kinds) < 3 else ""
    return with_unit(words, panel.unit)


def with_unit(words: str, unit: str) -> str:
    """Words and the unit, [1] for numbers without one."""
    return shown_text(f"{words} {unit_text(unit)}".strip())


def unit_text(unit: str) -> str:
    """A unit as figures show it, in brackets; lines are not broken within."""
    if unit == "SI":  # it depends on the row
        return "(SI\N{NO-BREAK SPACE}units)"
    shown = unit.replace("^2", "²").replace("^3", "³").replace(" ", "\N{NO-BREAK SPACE}")
    return f"[{shown}]"


def shown_text(words: str) -> str:
    """Words as matplotlib shows them: a $ begins no formula, a _ hides no curve.

    What no font draws, such as a control character, is left out.
    """
    kept = "\N{NO-BREAK SPACE}"
    words = "".join(c if c.isprintable() or c == kept else " " for c in words).replace("$", r"\$")
    return f" {words}" if words.startswith("_") else words


def columns_of(labels: Sequence[str], width: float) -> int:
    """How many columns of a legend fit a width, inches: letters, the line before them, a gap."""
    longest = max(map(len, labels))
    column = (0.56 * longest + 4.0) * LETTERS / 72.0
    rows = -(-len(labels) // max(1, int(width / column)))
    return -(-len(labels) // rows)


def _add_legend(ax: Axes, panel: Panel, width: float) -> None:
    """The legend above the axes, in as many columns as fit."""
    look: dict[str, Any] = dict(handlelength=1.8, columnspacing=1.0, handletextpad=0.5)
    labels = [curve.name for curve in panel.curves]
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns_of(labels, width - 0.6),
              fontsize=LETTERS, labelspacing=0.25, frameon=False, borderaxespad=0.2,
              **look)  # fmt: skip
