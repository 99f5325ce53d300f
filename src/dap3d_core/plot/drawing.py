"""Curves over time, or over one another: one panel for each unit."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.model.groups import Floats
from dap3d_core.result import Quantity, Result, find

#: Colours that colour-blind readers can tell apart, on white (Okabe and Ito 2008, without yellow).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Further curves repeat the colours with other dashes.
DASHES = ("-", "--", "-.", ":")
#: A single instant is drawn as markers, which may lie over one another.
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
#: Legends stand outside the axes: above them in figures narrower than this (inches), else beside.
NARROW = 5.5
WIDTH, HEIGHT, PANEL_HEIGHT = 6.4, 3.8, 2.4


class Curve(NamedTuple):
    """One line: its name in the legend, its values (nt,), and the quantity it belongs to."""

    name: str
    values: Floats
    quantity: Quantity


class Panel(NamedTuple):
    """The curves of one unit."""

    unit: str
    curves: list[Curve]


class Drawing(NamedTuple):
    """What a figure shows: panels over the values (nt,) of one quantity."""

    x: Quantity
    panels: list[Panel]


def plot(result: Result, *quantities: str, x: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw quantities of a result, those of different units in panels below one another.

    Args:
        result: what to draw from.
        quantities: names such as ``crank.r.z``, ``crank.w`` (all components), ``energy.total``.
        x: the quantity they are drawn over, one number an instant; time when left out.
        ax: where to draw; a new pyplot figure when left out.

    Returns:
        The axes, of the first panel where there are several (``ax.figure.axes`` has all).
        ``matplotlib.pyplot.show()`` shows them. A result of one instant is drawn as markers.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ValueError: no quantities, no instants, ``x`` has components, or ``ax`` is to take
            several units.
    """
    drawing = gather(result, quantities, x)
    if ax is None:
        from matplotlib import pyplot

        size = (WIDTH, height_of(drawing))
        return draw(pyplot.figure(figsize=size, layout="constrained"), drawing, result)[0]
    if len(drawing.panels) > 1:
        units = ", ".join(p.unit for p in drawing.panels)
        raise ValueError(f"one axes takes one unit; these quantities have {units}: leave ax out")
    draw_panel(ax, drawing, drawing.panels[0], ax.get_window_extent().height / ax.figure.dpi)
    if len(drawing.panels[0].curves) > 1:
        ax.legend(fontsize="small", framealpha=0.8)
    ax.set_xlabel(_with_unit(drawing.x.label, drawing.x.unit))
    return ax


def gather(result: Result, quantities: Sequence[str], x: str | None) -> Drawing:
    """What a figure of these quantities shows; errors as ``plot``."""
    if not quantities:
        raise ValueError("name at least one quantity, such as energy.total or BODY.r")
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to draw")
    over = find(result, x or "t")
    if over.values.ndim > 1:
        choices = ", ".join(f"{over.name}.{c}" for c in over.components)
        raise ValueError(f"x = {over.name} has components; name one of {choices}")
    panels: dict[str, Panel] = {}
    for quantity in (find(result, name) for name in dict.fromkeys(quantities)):
        panels.setdefault(quantity.unit, Panel(quantity.unit, [])).curves.extend(_curves(quantity))
    return Drawing(over, list(panels.values()))


def _curves(quantity: Quantity) -> Iterable[Curve]:
    if quantity.values.ndim == 1:
        return [Curve(quantity.name, quantity.values, quantity)]
    return [
        Curve(f"{quantity.name}.{part}", quantity.values[:, k], quantity)
        for k, part in enumerate(quantity.components)
    ]


def height_of(drawing: Drawing) -> float:
    """A good height for a figure, inches."""
    count = len(drawing.panels)
    return HEIGHT if count == 1 else PANEL_HEIGHT * count


def draw(figure: Figure, drawing: Drawing, result: Result) -> list[Axes]:
    """Draw all panels on an empty figure; returns their axes."""
    axes = figure.subplots(len(drawing.panels), 1, sharex=True, squeeze=False)[:, 0]
    height = figure.get_figheight() / len(axes)
    for ax, panel in zip(axes, drawing.panels, strict=True):
        draw_panel(ax, drawing, panel, height)
        if len(panel.curves) > 1:
            _add_legend(ax)
        ax.grid(True, alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel(_with_unit(drawing.x.label, drawing.x.unit))
    if result.record.title:
        words = result.record.title
        if result.status != "done":
            words += f" ({result.status})"
        figure.suptitle(_text(words), fontsize="medium")
    return list(axes)


def draw_panel(ax: Axes, drawing: Drawing, panel: Panel, height: float) -> None:
    """Draw the curves of one unit, with and their axis label.

    Args:
        ax: where.
        drawing: what the curves are drawn over.
        panel: the curves.
        height: of the panel, inches.
    """
    single = len(drawing.x.values) == 1
    for k, curve in enumerate(panel.curves):
        ax.plot(
            drawing.x.values,
            curve.values,
            color=PALETTE[k % len(PALETTE)],
            linestyle="none" if single else DASHES[k // len(PALETTE) % len(DASHES)],
            marker=MARKERS[k % len(MARKERS)] if single else "",
            markerfacecolor="none",
            linewidth=1.4,
            label=_text(curve.name),
        )
    room = max(14, int(13 * height))  # characters beside the axis
    ax.set_ylabel("\n".join(textwrap.wrap(_y_label(panel), room)))


def _y_label(panel: Panel) -> str:
    if len(panel.curves) == 1:
        return _with_unit(panel.curves[0].quantity.label, panel.unit)
    whole = list(dict.fromkeys(c.quantity.label for c in panel.curves))
    kinds = list(dict.fromkeys(c.quantity.kind for c in panel.curves))
    words = whole[0] if len(whole) == 1 else ", ".join(kinds) if len(kinds) < 3 else ""
    return _with_unit(words, panel.unit)


def _with_unit(words: str, unit: str) -> str:
    shown = unit.replace("^2", "²")
    return _text(words if unit == "1" else f"{words} [{shown}]".strip())


def _text(words: str) -> str:
    """Words as matplotlib shows them: a $ begins no formula, a _ hides no curve."""
    words = words.replace("$", r"\$")
    return f" {words}" if words.startswith("_") else words


def _add_legend(ax: Axes) -> None:
    if ax.figure.bbox.width / ax.figure.dpi < NARROW:
        ax.legend(fontsize="x-small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3,
                  frameon=False, borderaxespad=0.2)  # fmt: skip
    else:
        ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0),
                  frameon=False, borderaxespad=0.0)  # fmt: skip
