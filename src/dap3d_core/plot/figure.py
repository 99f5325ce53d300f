"""``plot``, ``save_plot`` and ``show_plot``: results, fits, linearisations, sweeps as figures."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.curves import curve_picture
from dap3d_core.plot.figure_file import check_suffix, save_figure
from dap3d_core.plot.style import HEIGHT, LETTERS, PALETTE, WIDTH, Picture, style_axes
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, ResultError

if TYPE_CHECKING:
    import xarray

    from dap3d_core.simulation.linearization.linearization import Linearization
    from dap3d_core.study.equilibrium_path import EquilibriumPath
    from dap3d_core.study.fit.fit_result import Fit
    from dap3d_core.study.modes_over import ModesOver

    Drawable = (
        Result | Mapping[str, Result] | Fit | Linearization | ModesOver | EquilibriumPath
        | xarray.Dataset
    )  # fmt: skip
    from dap3d_core.simulation.linearization.linearization import Linearization

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
#: A real part below this part of the largest magnitude is drawn as zero.
ROUNDING = 1e-9


def picture_of(
    result: "Drawable", quantities: Sequence[str], x: str | None, at: Mapping[str, float] | None
) -> Picture:
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
        from dap3d_core.plot.equilibrium_path import EquilibriumPathPicture

        return EquilibriumPathPicture(cast("EquilibriumPath", result), names)
    drawn = result.values() if isinstance(result, Mapping) else [result]
    is_result = all(isinstance(one, Result) for one in drawn)
    if (
        not is_result
        and not hasattr(result, "mode_eigenvalues")
        and not hasattr(result, "measured")
    ):
        words = (
            "a Result, a dictionary of these, a Fit, a Linearization, a ModesOver, an "
            "EquilibriumPath or the data of a sweep"
        )
        reader = f"; dap.open({result!r}) reads one" if isinstance(result, (str, Path)) else ""
        raise TypeError(f"the argument result should be {words}, not {result!r}{reader}")
    if at:
        raise ValueError("at chooses points of a sweep; this is none")
    if isinstance(result, (Result, Mapping)):
        return curve_picture(cast("Result | Mapping[str, Result]", result), names, x)
    if x is not None:
        raise ValueError("a fit or a linearisation has an x axis of its own: leave x out")
    if hasattr(result, "mode_eigenvalues"):
        if names:
            raise ValueError("of a linearisation the eigenvalues are drawn: leave names out")

        return EigenvaluePicture(cast("Linearization", result))
    from dap3d_core.plot.fit import fit_picture

    return fit_picture(result, names)


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

    size = (WIDTH, picture.height)
    return picture.draw(pyplot.figure(figsize=size, layout="constrained", dpi=SCRIPT_DPI))[0]


def save_plot(
    result: "Drawable",
    quantities: str | Sequence[str],
    path: str | os.PathLike[str],
    *,
    x: str | None = None,
    at: Mapping[str, float] | None = None,
    width: float = WIDTH,
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
    width: float = WIDTH,
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


class EigenvaluePicture(Picture):
    """The eigenvalues of a linearisation.

    Modes have their numbers; those that grow are drawn as crosses, to the right of the axis.
    """

    def __init__(self, linearization: "Linearization") -> None:
        self.linearization = linearization

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        return [self.draw_on(figure.add_subplot())]

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user."""
        return draw_eigenvalues(ax, self.linearization)


def draw_eigenvalues(ax: Axes, linearization: "Linearization") -> Axes:
    """Draw the eigenvalues of a linearisation on axes; returns these."""
    values = linearization.eigenvalues
    size = float(np.max(np.abs(values), initial=0.0)) or 1.0
    real = np.where(np.abs(values.real) > ROUNDING * size, values.real, 0.0)
    grows = real > 0.0
    ax.axvline(0.0, color="0.6", linewidth=0.8)
    ax.plot(real[~grows], values.imag[~grows], "o", color=PALETTE[0], markersize=4.5)
    ax.plot(real[grows], values.imag[grows], "X", color=PALETTE[1], markersize=5.5)
    modes = linearization.mode_eigenvalues
    for k, value in enumerate(modes[:MOST_LABELS]):
        x = value.real if abs(value.real) > ROUNDING * size else 0.0
        if abs(value) > 0.0:
            ax.annotate(str(k + 1), (x, value.imag), xytext=(4, 3), textcoords="offset points",
                        fontsize=LETTERS)  # fmt: skip
    if not np.any(real):
        ax.set_xlim(-size, size)
    ax.margins(0.12)
    ax.set_xlabel("real part [1/s]", fontsize=LETTERS)
    ax.set_ylabel("imaginary part [rad/s]", fontsize=LETTERS)
    style_axes(ax)
    return ax
