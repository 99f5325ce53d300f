"""Curves over time, or over one another, of one run or several: one panel for each unit."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.model.groups import Floats
from dap3d_core.plot import style
from dap3d_core.result import Quantity, Result, UnknownNameError, find
from dap3d_core.result.arrays import POINT
from dap3d_core.result.post.smooth_parts import cubic, smooth_parts

#: A curve of fewer instants is drawn through about so many points.
POINTS = 600
#: So many instants, or fewer, have a marker each.
FEW = 50
#: Quantities that are drawn on the scale of the energies of their run.
ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")
#: Mode -> word and colour; open contacts have the colour of the page.
LOOKS = {1: ("slides", "#F6D9B8"), 2: ("sticks", "#CFE5CF")}
#: Parts of the width of a panel from which on a band has its word, upright and as written.
ROOM, ENOUGH = 0.04, 0.16


def _shaped(t: Floats, x: Floats, cuts: Sequence[float]) -> Floats:
    """Slopes (2, nt - 1) at both ends of each interval that keep the shape of x (nt,).

    Between two instants a cubic of them rises or falls throughout, and stays between the values
    (Fritsch and Carlson 1980). It is NaN where an interval has a cut, and beside NaN.
    """
    from scipy.interpolate import PchipInterpolator

    slopes = np.full((2, len(t) - 1), np.nan)
    broken = np.isnan(x[:-1]) | np.isnan(x[1:])
    broken[[k - 1 for k in np.searchsorted(t, cuts) if 0 < k < len(t)]] = True
    for first, last in pairwise([-1, *np.flatnonzero(broken), len(t) - 1]):
        if last > first + 1:
            part = slice(first + 1, last + 1)
            of_part = PchipInterpolator(t[part], x[part])(t[part], 1)
            slopes[:, first + 1 : last] = of_part[:-1], of_part[1:]
    return slopes


def _refined(t: Floats, x: Floats, x_dot: Floats | None, cuts: Sequence[float]) -> Floats:
    """A curve x (nt,), at its instants and at equal fractions between.

    Between them it is a cubic of the derivative x_dot, or of slopes that keep the shape where this
    is None; a straight line where neither is known, which is NaN, as in an interval with a cut.
    """
    between = _between(len(t))
    if between == 1:
        return x
    h, ends = np.diff(t), np.stack([x[:-1], x[1:]])
    rates = _shaped(t, x, cuts) if x_dot is None else np.stack([x_dot[:-1], x_dot[1:]])
    rates = np.where(np.isnan(rates), np.diff(x) / h, rates)
    pieces = [cubic(k / between, h, ends, rates) for k in range(between)]
    return np.append(np.stack(pieces, axis=1).reshape(-1), x[-1])


def _between(count: int) -> int:
    """Points of a curve for each of its instants."""
    return -(-POINTS // count) if 1 < count < POINTS else 1


def smooth(result: Result, x: Floats, y: Floats, x_dot: Floats | None, y_dot: Floats | None
           ) -> tuple[Floats, Floats]:  # fmt: skip
    """A curve (x, y) (nt,) of a result, smooth between its instants but for its switches."""
    cuts = [event.t for event in result.events if event.kind != "record"]
    return _refined(result.t, x, x_dot, cuts), _refined(result.t, y, y_dot, cuts)


def rate_of(result: Result, quantity: Quantity) -> Floats | None:
    """The derivative of a quantity in time, None where it is not known."""
    if quantity.name == "t":
        return np.ones(len(result.t))
    return find(result, quantity.rate).values if quantity.rate else None


class Curve(NamedTuple):
    """One line: its name in the legend, its points, the quantity, the number of its run.

    ``instants`` are the places of the instants among the points. ``drift`` are words on the drift
    of a conserved energy; the axis spans ``span`` or more.
    """

    name: str
    points: tuple[Floats, Floats]
    quantity: Quantity
    run: int
    instants: list[int]
    drift: str = ""
    span: float = 0.0


@attrs.frozen(eq=False)
class CurvePicture(style.StackedPanels):
    """Panels of curves over one quantity: unit -> curves; a title above them.

    bands: unit -> modes of the contact of its curves over time.
    """

    x: Quantity
    panels: dict[str, list[Curve]]
    title: str
    bands: "Mapping[str, Sequence[Band]]" = attrs.field(factory=dict)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw all panels on an empty figure; returns their axes."""
        axes, width, height = self.axes_on(figure)
        for ax, (unit, curves) in zip(axes, self.panels.items(), strict=True):
            self._draw_panel(ax, unit, curves, height)
            if len(curves) > 1:
                style.legend_above(ax, [curve.name + curve.drift for curve in curves], width)
            style.style_axes(ax)
        label = style.with_unit(self.x.label, self.x.unit)
        axes[-1].set_xlabel(style.folded(label, 17 * width), fontsize=style.LETTERS)
        if self.x.name != "t" and list(self.panels) == [self.x.unit]:  # the path of a point
            axes[0].set_aspect("equal", adjustable="datalim")
        if self.title:
            figure.suptitle(style.shown_text(self.title), fontsize=style.LETTERS + 1)
        return axes

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
        ax.set_xlabel(style.with_unit(self.x.label, self.x.unit))
        return ax

    def _draw_panel(self, ax: Axes, unit: str, curves: Sequence[Curve], height: float) -> None:
        """Draw the curves of one unit in a panel of a height (inches).

        Colours differ from curve to curve, dashes from run to run: curves that lie on one another
        are still seen.
        """
        _shade(ax, self.bands.get(unit, ()))
        several = len({curve.run for curve in curves}) > 1
        for k, curve in enumerate(curves):
            single = len(curve.quantity.values) == 1
            dash = curve.run if several else k // len(style.PALETTE)
            ax.plot(
                *curve.points,
                color=style.PALETTE[k % len(style.PALETTE)],
                linestyle="none" if single else style.DASHES[dash % len(style.DASHES)],
                linewidth=1.4,
                **self._marks(curve, style.MARKERS[k % len(style.MARKERS)] if single else "o"),
                label=style.shown_text(curve.name + (curve.drift if len(curves) > 1 else "")),
            )
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(style.PlainOffset())
        style.show_rounding_flat(ax, max(curve.span for curve in curves))
        labels = list(dict.fromkeys(c.quantity.label for c in curves))
        kinds = list(dict.fromkeys(c.quantity.kind for c in curves))
        words = labels[0] if len(labels) == 1 else ", ".join(kinds) if len(kinds) < 3 else ""
        label = style.with_unit(words + (curves[0].drift if len(curves) == 1 else ""), unit)
        ax.set_ylabel(style.folded(label, 15 * height), fontsize=style.LETTERS)

    def _marks(self, curve: Curve, start: str) -> dict[str, Any]:
        """Dots at the instants of a curve over time where these are few; else one at a start."""
        if self.x.name == "t" and 1 < len(curve.instants) <= FEW:
            return {"marker": ".", "markevery": curve.instants, "markersize": 4.0}
        seen = self.x.name != "t" or len(curve.instants) == 1
        return {"marker": start if seen else "", "markevery": [0], "markersize": 4.5,
                "markerfacecolor": "none"}  # fmt: skip


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
    bands = {}
    if len(runs) == 1 and over.name == "t":
        (run,) = runs.values()
        bands = {unit: _bands_of(run, (c.quantity for c in of)) for unit, of in panels.items()}
    return CurvePicture(over, panels, titles[0] if len(titles) == 1 else "", bands)


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
        choices = ", ".join(over.columns)
        raise ValueError(f"x = {over.name} has components; name one of {choices}")
    return over, quantities


def _title_of(result: Result) -> str:
    title = result.record.title
    return f"{title} ({result.status})" if title and result.status != "done" else title


def _curves(
    result: Result, over: Quantity, quantity: Quantity, number: int, run: str, *, alone: bool
) -> Iterable[Curve]:
    """The curves of a quantity of a run; ``alone`` in its panel, it has the name of its run."""
    parts = smooth_parts(result)
    of_parts = [
        _points(part, over, quantity)
        if part is result
        else _points(part, find(part, over.name), find(part, quantity.name))
        for part in parts
    ]
    starts = accumulate((len(part[0][0]) + 1 for part in of_parts[:-1]), initial=0)
    instants = [start + k * _between(len(part.t))
                for start, part in zip(starts, parts, strict=True)
                for k in range(len(part.t))]  # fmt: skip
    for name, *points in zip(quantity.columns, *of_parts, strict=True):
        label = run if alone and run else ", ".join(part for part in (name, run) if part)
        drift, span = drift_of(result, quantity), span_of(result, quantity)
        yield Curve(label, _interrupted(points), quantity, number, instants, drift, span)


def _points(result: Result, over: Quantity, quantity: Quantity) -> list[tuple[Floats, Floats]]:
    """The curve of each component of a quantity."""
    columns = quantity.values.reshape(len(result.t), -1).T
    over_rate, rate = rate_of(result, over), rate_of(result, quantity)
    rates = [None] * len(columns) if rate is None else rate.reshape(len(result.t), -1).T
    return [smooth(result, over.values, values, over_rate, own)
            for values, own in zip(columns, rates, strict=True)]  # fmt: skip


def _interrupted(parts: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Curves one behind the other, with a gap between two."""
    if len(parts) == 1:
        return parts[0]
    gap = np.full(1, np.nan)
    x, y = (np.concatenate([z for part in axis for z in (part, gap)][:-1])
            for axis in zip(*parts, strict=True))  # fmt: skip
    return x, y


def span_of(result: Result, quantity: Quantity) -> float:
    """The span, J, that an axis should have at least to show an energy of a run, else 0.

    It is the larger of the changes of kinetic and potential energy. Where neither changes by more
    than the ledger allows for errors, as of a body that turns freely, it is the kinetic energy.
    """
    if quantity.name not in ENERGIES:
        return 0.0
    kinetic, potential = result.energy.kinetic, result.energy.potential
    exchanged, most = max(float(np.ptp(kinetic)), float(np.ptp(potential))), float(kinetic.max())
    entry = result.ledger.get("energy")
    errors = most * (entry.limit or 0.0) if entry else 0.0
    return exchanged if exchanged > errors else most


def drift_of(result: Result, quantity: Quantity) -> str:
    """Words on the drift of the total energy of a run that should conserve it, else "".

    It is relative, as the ledger's: "total energy" where there are potentials, "energy" of bodies
    on which nothing does work.
    """
    if quantity.name != "energy.total":
        return ""
    free = not result.summary.has_potential and not np.any(result.work - result.work[0])
    entry = result.ledger.get("energy" if free else "total energy")
    return f" (drift {entry.value:.1g})" if entry else ""


class Band(NamedTuple):
    """A contact is in a mode from one instant to another, s."""

    start: float
    end: float
    mode: int


def _bands_of(result: Result, quantities: Iterable[Quantity]) -> list[Band]:
    """The bands of the contact of some quantities; none where they are of two or more, or none.

    A contact with several points sticks where one of them does. Between two reports a change is at
    the last event there.
    """
    heads = {q.name.split(".")[0] for q in quantities if q.owner == "contact"}
    if len(heads) != 1 or len(result.t) < 2:
        return []
    (name,) = heads
    modes: Any = np.asarray(result.contact(name).mode, dtype=float)
    modes = modes.reshape(len(result.t), -1).max(axis=1)
    if not np.isfinite(modes).all():
        return []
    cuts = [float(result.t[0])]
    for before, after in pairwise(range(len(modes))):
        if modes[before] != modes[after]:
            first, last = float(result.t[before]), float(result.t[after])
            found = [
                e.t
                for e in result.events
                if e.name.split(POINT)[0] == name.split(POINT)[0] and first <= e.t <= last
            ]
            cuts.append(found[-1] if found else 0.5 * (first + last))
    cuts.append(float(result.t[-1]))
    kept = [modes[0], *(b for a, b in pairwise(modes) if a != b)]
    return [Band(a, b, int(mode)) for (a, b), mode in zip(pairwise(cuts), kept, strict=True)]


def _shade(ax: Axes, bands: Sequence[Band]) -> None:
    """Draw bands behind the curves, each mode with its word in its widest band."""
    width = bands[-1].end - bands[0].start if bands else 0.0
    for mode, (word, color) in LOOKS.items():
        alike = [band for band in bands if band.mode == mode]
        for band in alike:
            ax.axvspan(band.start, band.end, color=color, linewidth=0.0, zorder=0.0)
        widest = max(alike, key=lambda band: band.end - band.start, default=None)
        room = widest.end - widest.start if widest is not None else 0.0
        if widest is not None and room > ROOM * width:
            ax.text(
                0.5 * (widest.start + widest.end), 0.5, word, transform=ax.get_xaxis_transform(),
                rotation=0 if room > ENOUGH * width else 90, ha="center", va="center",
                fontsize=style.LETTERS, color="#444444",
            )  # fmt: skip
