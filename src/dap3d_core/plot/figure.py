"""``plot``, ``save_plot`` and ``show_plot``: results, fits, linearisations, sweeps as figures."""

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import attrs
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.kernels.array_types import Floats
from dap3d_core.plot import style
from dap3d_core.plot.curves import curve_picture, rate_of, smooth
from dap3d_core.plot.figure_file import check_suffix, save_figure
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Quantity, Result, ResultError, find
from dap3d_core.result.errors import unknown
from dap3d_core.study.fit.fit_result import Fit

if TYPE_CHECKING:
    import xarray

    from dap3d_core.simulation.linearization.linearization import Linearization
    from dap3d_core.study.equilibrium_path import EquilibriumPath
    from dap3d_core.study.modes_over import ModesOver
    from dap3d_core.study.sensitivities.sensitivities import Sensitivities

    Drawable = (
        Result | Mapping[str, Result] | Fit | Linearization | ModesOver | EquilibriumPath
        | xarray.Dataset
    )  # fmt: skip

#: Backends that matplotlib falls back on where it cannot open windows.
FILE_BACKENDS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")
#: Dots an inch of a figure of a script, and of a window, which shows it larger than paper does.
SCRIPT_DPI, WINDOW_DPI = 150.0, 170.0
NO_WINDOW = (
    "cannot open a window: there is no display, or no package that opens windows (pip install "
    "PyQt6); -o writes a file instead"
)
#: Eigenvalues whose numbers are written beside them.
MOST_LABELS = 12
#: Attribute of a path -> label, marker and colour of its special points.
SPECIAL = {
    "turning": ("turning point", "o", style.PALETTE[1]),
    "branching": ("another path crosses", "D", style.PALETTE[3]),
}
#: A step is drawn by so many pieces; shorter steps, parts of the range, are at a corner.
BETWEEN, CORNER = 8, 1e-4
#: Legends have the entry of stability where it changes.
STABILITY = ((True, "stable", "-"), (False, "unstable", "--"))
#: Inches: of a panel with points and curve, and of the one with residuals below it.
CURVE_HEIGHT, RESIDUAL_HEIGHT = 1.7, 0.9


def picture_of(
    result: "Drawable", quantities: Sequence[str], x: str | None, at: Mapping[str, float] | None
) -> style.Picture:
    """The picture of a result, of several by name, of a fit or of a sweep; errors as ``plot``."""
    names = [quantities] if isinstance(quantities, str) else list(quantities)
    if hasattr(result, "data_vars"):  # a data set of xarray, which is a mapping as well
        from dap3d_core.plot.sweep.sweep_plot import sweep_picture

        return sweep_picture(cast("xarray.Dataset", result), names, x, at)
    if hasattr(result, "grows"):
        from dap3d_core.plot.modes_over import modes_over_picture

        return modes_over_picture(cast("ModesOver", result), names, x, at)
    if hasattr(result, "turning"):
        if x is not None or at:
            raise ValueError("a path of equilibria is drawn over its parameter: leave x and at out")
        return EquilibriumPathPicture(cast("EquilibriumPath", result), names)
    drawn = result.values() if isinstance(result, Mapping) else [result]
    are_runs = all(isinstance(one, Result) for one in drawn)
    if not (are_runs or hasattr(result, "mode_eigenvalues") or hasattr(result, "measured")):
        words = (
            "a Result, a dictionary of these, a Fit, a Linearization, a ModesOver, an "
            "EquilibriumPath or the data of a sweep"
        )
        reader = f"; dap.open({result!r}) reads one" if isinstance(result, (str, Path)) else ""
        raise TypeError(f"the argument result should be {words}, not {result!r}{reader}")
    if at:
        raise ValueError("at chooses points of a sweep; this is none")
    if are_runs:
        return curve_picture(cast("Result | Mapping[str, Result]", result), names, x)
    if x is not None:
        raise ValueError("a fit or a linearisation has an x axis of its own: leave x out")
    if hasattr(result, "mode_eigenvalues"):
        if names:
            raise ValueError("of a linearisation the eigenvalues are drawn: leave names out")
        return EigenvaluePicture(cast("Linearization", result))
    return FitPicture.of(cast("Fit", result), names)


@checked
def plot(
    result: "Drawable",
    *quantities: str,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw quantities of a result, or outputs of a sweep, in panels below one another.

    Args:
        result: a ``Result``; several as names and results, {"rtol 1e-6": result, ...}; a ``Fit``:
            its data, its curves and its residuals; a ``Linearization``: its eigenvalues; a
            ``ModesOver``: its frequencies, or with "eigenvalues" its root locus; an
            ``EquilibriumPath``: quantities over its parameter; or the data set of a sweep.
        quantities: names such as ``crank.r.z``, ``crank.w`` (all components), ``energy.total``;
            each unit has a panel of its own. Of a fit its outputs, by default all. Of a sweep as
            well: lines over one number, a map over two, parallel coordinates over more, curves
            over time (docs/how-to/look-at-sweeps.md).
        x: the quantity on the x axis, one number an instant; by default time. A path, a length
            over a length, has one scale on both axes; a circle marks its start. Of a sweep a
            number or an output.
        at: of a sweep: number -> value; only the nearest points are drawn.
        ax: the axes; by default a new pyplot figure.

    Returns:
        The axes, of the first panel where there are several (``ax.figure.axes`` has all).
        ``matplotlib.pyplot.show()`` shows them. A result of one instant is drawn as markers.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ValueError: no runs, no quantities, no instants, ``x`` has components, or ``ax`` is to take
            several units; a sweep without values, or a data set that is no sweep.
    """
    picture = picture_of(result, quantities, x, at)
    if ax is not None:
        return picture.draw_on(ax)
    from matplotlib import pyplot

    size = (style.WIDTH, picture.height)
    return picture.draw(pyplot.figure(figsize=size, layout="constrained", dpi=SCRIPT_DPI))[0]


def save_plot(
    result: "Drawable",
    quantities: str | Sequence[str],
    path: str | os.PathLike[str],
    *,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    width: float = style.WIDTH,
    height: float | None = None,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw quantities as ``plot`` does, into a file; needs no display. Returns the path.

    Args:
        result, quantities, x, at: as for ``plot``; one name or several.
        path: the file; its suffix gives the format, .png, .svg or .pdf.
        width, height: size in inches; by default a height that suits the number of panels.
        dpi: dots an inch of a PNG.
        force: overwrites an existing file.

    Raises:
        UnknownNameError, ValueError: as ``plot``; also for an invalid suffix or size.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    check_suffix(target)
    picture = picture_of(result, quantities, x, at)
    size = (width, picture.height if height is None else height)
    return save_figure(picture.draw, target, size, dpi, force=force)


def show_plot(
    result: "Drawable",
    quantities: str | Sequence[str],
    *,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    width: float = style.WIDTH,
    height: float | None = None,
) -> None:
    """Draw quantities as ``plot`` does, in a window; returns when it is closed.

    Raises:
        UnknownNameError, ValueError: as ``plot``.
        ResultError: there is no display, or no package that opens windows.
    """
    picture = picture_of(result, quantities, x, at)
    from matplotlib import pyplot

    size = (width, picture.height if height is None else height)
    try:
        figure = pyplot.figure(figsize=size, layout="constrained", dpi=WINDOW_DPI)
    except ImportError as error:  # the environment names a backend that is not installed
        raise ResultError(NO_WINDOW) from error
    if matplotlib.get_backend().lower() in FILE_BACKENDS:
        pyplot.close(figure)
        raise ResultError(NO_WINDOW)
    picture.draw(figure)
    pyplot.show()
    pyplot.close(figure)


@attrs.frozen(eq=False)
class EigenvaluePicture(style.OnePanel):
    """The eigenvalues of a linearisation.

    Modes have their numbers; those that grow are drawn as crosses, to the right of the axis.
    """

    linearization: "Linearization"

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user."""
        values = self.linearization.eigenvalues
        size = float(np.max(np.abs(values), initial=0.0)) or 1.0
        real = np.where(np.abs(values.real) > style.REAL_PART_ROUNDING * size, values.real, 0.0)
        grows = real > 0.0
        ax.axvline(0.0, color="0.6", linewidth=0.8)
        ax.plot(real[~grows], values.imag[~grows], "o", color=style.PALETTE[0], markersize=4.5)
        ax.plot(real[grows], values.imag[grows], "X", color=style.PALETTE[1], markersize=5.5)
        modes = self.linearization.mode_eigenvalues[:MOST_LABELS]
        for value, numbers in _labels_of(modes.tolist(), np.ptp([*values.real, 0.0]), 2.0 * size):
            x = value.real if abs(value.real) > style.REAL_PART_ROUNDING * size else 0.0
            ax.annotate(numbers, (x, value.imag), xytext=(4, 3), textcoords="offset points",
                        fontsize=style.LETTERS)  # fmt: skip
        if not np.any(real):
            ax.set_xlim(-size, size)
        ax.margins(0.12)
        style.style_axes(ax, style.REAL_PART, style.IMAGINARY_PART)
        return ax


def _labels_of(values: Sequence[complex], width: float, height: float) -> list[tuple[complex, str]]:
    """Eigenvalues other than zero with the numbers of their modes.

    Modes closer than letters have one label, at the first of them.
    """
    groups: list[tuple[complex, list[int]]] = []
    for k, value in enumerate(values):
        near = [
            numbers
            for first, numbers in groups
            if abs(value.real - first.real) < 0.1 * width + 1e-9 * height
            and abs(value.imag - first.imag) < 0.06 * height
        ]
        if near:
            near[0].append(k + 1)
        elif value:
            groups.append((value, [k + 1]))
    return [(first, ", ".join(map(str, numbers))) for first, numbers in groups]


class EquilibriumPathPicture(style.StackedPanels):
    """A panel for each quantity, over the parameter."""

    def __init__(self, path: "EquilibriumPath", quantities: Sequence[str]) -> None:
        self.path = path
        self.panels = [path.quantity(name) for name in quantities or [path.largest_motion()]]

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw all panels on an empty figure; returns their axes."""
        axes, width, height = self.axes_on(figure)
        for ax, panel in zip(axes, self.panels, strict=True):
            self._draw_panel(ax, panel, height)
        _, labels = axes[0].get_legend_handles_labels()
        if labels:
            style.legend_above(axes[0], labels, width)
        for ax in axes[:-1]:
            ax.set_xlabel("")
        return axes

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user; a ValueError where there are several quantities."""
        if len(self.panels) > 1:
            raise ValueError("one axes takes one quantity: leave ax out")
        self._draw_panel(ax, self.panels[0], ax.get_window_extent().height / ax.figure.dpi)
        if ax.get_legend_handles_labels()[1]:
            ax.legend(fontsize=style.LETTERS, frameon=False)
        return ax

    def _draw_panel(self, ax: Axes, panel: Quantity, height: float) -> None:
        path, columns = self.path, panel.values.reshape(len(self.path.values), -1)
        for k, values in enumerate(columns.T):
            colour = style.PALETTE[k % len(style.PALETTE)]
            fine, x, y = _smooth(path.length, path.values, values)
            for stable, rows in _runs(path):
                dash = next(dash for which, _, dash in STABILITY if which == stable)
                ends = path.length[rows][[0, -1]]
                part = (fine >= ends[0]) & (fine <= ends[1])
                ax.plot(x[part], y[part], dash, color=colour, linewidth=1.4)
            if panel.components:
                name = style.shown_text(panel.columns[k])
                ax.plot([], [], color=colour, linewidth=1.4, label=name)
        if not (path.stable.all() or not path.stable.any()):
            for _, label, dash in STABILITY:
                ax.plot([], [], dash, color="0.3", linewidth=1.4, label=label)
        for mark, (label, marker, colour) in SPECIAL.items():
            where = getattr(path, mark)
            if where.any():
                x = np.repeat(path.values[where], columns.shape[1])
                ax.plot(x, columns[where].ravel(), marker, color=colour, linestyle="",
                        markersize=5.0, label=label, zorder=3)  # fmt: skip
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(style.PlainOffset())
        style.show_rounding_flat(ax)
        label = style.folded(style.with_unit(panel.label, panel.unit), 15 * height)
        style.style_axes(ax, style.with_unit(path.parameter, path.unit), label)


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


@attrs.frozen(eq=False)
class FitPicture(style.Picture):
    """Outputs of a fit, each with its residuals below."""

    refusal = "a fit is drawn over time, on a figure of its own: leave x, ax out"

    fit: Fit
    outputs: list[str]

    @classmethod
    def of(cls, fit: Fit, outputs: Sequence[str]) -> "FitPicture":
        """Of outputs, by default of all; unknown ones are an UnknownNameError."""
        for name in outputs:
            if name not in fit.measured:
                raise unknown("output of the fit", name, fit.measured)
        return cls(fit, list(dict.fromkeys(outputs)) or list(fit.measured))

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return 0.6 + (CURVE_HEIGHT + RESIDUAL_HEIGHT) * len(self.outputs)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure; returns the axes."""
        ratios = [CURVE_HEIGHT, RESIDUAL_HEIGHT] * len(self.outputs)
        axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        for name, above, below in zip(self.outputs, axes[::2], axes[1::2], strict=True):
            self._draw_output(name, above, below)
            for ax in (above, below):
                ax.yaxis.set_major_formatter(style.PlainOffset())
                ax.ticklabel_format(axis="y", scilimits=(-3, 4))
        style.legend_above(axes[0], ("measured", "fitted"), figure.get_figwidth())
        axes[-1].set_xlabel("time [s]", fontsize=style.LETTERS)
        figure.align_ylabels(axes)
        if title := self.fit.result.record.title:
            figure.suptitle(style.shown_text(title), fontsize=style.LETTERS + 1)
        return list(axes)

    def _draw_output(self, name: str, above: Axes, below: Axes) -> None:
        fit, t = self.fit, self.fit.result.t
        curve = find(fit.result, fit.quantities[name])
        points = smooth(fit.result, t, curve.values, np.ones(len(t)), rate_of(fit.result, curve))
        marks: Any = dict(color=style.PALETTE[1], linestyle="none", marker="o", markersize=2.5,
                          markeredgewidth=0.0, alpha=0.7)  # fmt: skip
        above.plot(fit.t, fit.measured[name], label="measured", **marks)
        above.plot(*points, color=style.PALETTE[0], linewidth=1.2, label="fitted")
        label = style.folded(style.with_unit(curve.label, curve.unit), 15 * CURVE_HEIGHT)
        style.style_axes(above, y_label=label)
        sigma, residuals = fit.sigma.get(name), fit.residuals[name]
        if sigma is None:
            below.plot(fit.t, residuals, **marks)
        else:
            below.errorbar(fit.t, residuals, sigma, elinewidth=0.5, **marks)
        below.axhline(0.0, color=style.PALETTE[0], linewidth=1.0)
        style.style_axes(below, y_label=f"residual\n{style.unit_text(curve.unit)}")
        reach = np.abs(residuals) + (0.0 if sigma is None else sigma)
        if (reach > 0.0).any():
            limit = 1.15 * np.nanmax(reach)
            below.set_ylim(-limit, limit)


@attrs.frozen(eq=False)
class SensitivityPicture(style.Picture):
    """For each quantity its elasticities at the end, and p dq/dp over time.

    Attributes:
        sensitivities: of the run.
        quantities: scalar ones, by name.
    """

    refusal = "sensitivities have several panels: leave ax out"

    sensitivities: "Sensitivities"
    quantities: tuple[str, ...]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return style.PANEL_HEIGHT * len(self.quantities)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        found = self.sensitivities
        panels = figure.subplots(len(self.quantities), 2, squeeze=False)
        for (bars, curves), quantity in zip(panels, self.quantities, strict=True):
            elasticities = np.nan_to_num(found.elasticities(quantity), posinf=0.0, neginf=0.0)
            colors = [style.PALETTE[k % len(style.PALETTE)] for k in range(len(found.names))]
            bars.barh(list(found.names), elasticities, color=colors)
            bars.invert_yaxis()
            bars.axvline(0.0, color="0.5", linewidth=0.8)
            style.style_axes(bars, f"% of {quantity} by 1 %")
            for k, curve in enumerate((found.of(quantity) * found.values).T):
                curves.plot(found.result.t, curve, color=colors[k], linewidth=1.2)
            style.style_axes(curves, "t [s]", f"p d {quantity} / dp")
        return list(panels.flat)
