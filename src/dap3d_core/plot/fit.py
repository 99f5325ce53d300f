"""A fit: measured points, the curve of the fitted run, and what is left between them."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.curves import (
    LETTERS,
    PALETTE,
    WIDTH,
    shown_text,
    smooth,
    unit_text,
    with_unit,
    wrapped,
)
from dap3d_core.plot.figure import save_figure
from dap3d_core.plot.ticks import PlainOffset
from dap3d_core.result import find
from dap3d_core.result.errors import unknown
from dap3d_core.study.fit.fit_result import Fit

#: Inches: of a panel with points and curve, and of the one with residuals below it.
CURVE_HEIGHT, RESIDUAL_HEIGHT = 1.7, 0.9


def plot_fit(fit: Fit, outputs: Sequence[str] = ()) -> Axes:
    """Draw a fit on a new pyplot figure; returns its first axes.

    Raises:
        UnknownNameError: it has no such output; names the nearest.
    """
    from matplotlib import pyplot

    names = _chosen(fit, outputs)
    size = (WIDTH, height_of_fit(len(names)))
    return draw_fit(pyplot.figure(figsize=size, layout="constrained", dpi=150), fit, names)[0]


def save_fit(
    fit: Fit,
    path: str | os.PathLike[str],
    outputs: Sequence[str] = (),
    *,
    width: float = WIDTH,
    height: float | None = None,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw a fit into a file; needs no display.

    Args:
        fit: what ``fit`` returned.
        path: the file; its suffix says what it is, .png, .svg or .pdf.
        outputs: which are drawn; all when left out.
        width, height: size in inches; the height fits the number of panels when left out.
        dpi: dots an inch of a PNG.
        force: whether an existing file is overwritten.

    Raises:
        UnknownNameError, ValueError, ResultError: as ``save_plot``.
    """
    names = _chosen(fit, outputs)
    size = (width, height_of_fit(len(names)) if height is None else height)
    return save_figure(lambda f: draw_fit(f, fit, names), Path(path), size, dpi, force=force)


def height_of_fit(count: int) -> float:
    """A good height for a figure with so many outputs, inches."""
    return 0.6 + (CURVE_HEIGHT + RESIDUAL_HEIGHT) * count


def draw_fit(figure: Figure, fit: Fit, outputs: Sequence[str]) -> list[Axes]:
    """Draw outputs on an empty figure, each with its residuals below; returns the axes."""
    ratios = [CURVE_HEIGHT, RESIDUAL_HEIGHT] * len(outputs)
    axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    for name, above, below in zip(outputs, axes[::2], axes[1::2], strict=True):
        curve = find(fit.result, fit.quantities[name])
        point = {"color": PALETTE[1], "linestyle": "none", "marker": "o", "markersize": 2.5,
                 "markeredgewidth": 0.0, "alpha": 0.7}  # fmt: skip
        sigma = fit.sigma.get(name)
        above.plot(fit.t, fit.measured[name], label="measured", **point)
        above.plot(*smooth(fit.result, curve), color=PALETTE[0], linewidth=1.2, label="fitted")
        above.set_ylabel(wrapped(with_unit(curve.label, curve.unit), 15 * CURVE_HEIGHT),
                         fontsize=LETTERS)  # fmt: skip
        if sigma is None:
            below.plot(fit.t, fit.residuals[name], **point)
        else:
            below.errorbar(fit.t, fit.residuals[name], sigma, elinewidth=0.5, **point)
        below.axhline(0.0, color=PALETTE[0], linewidth=1.0)
        below.set_ylabel(f"residual\n{unit_text(curve.unit)}", fontsize=LETTERS)
        reach = np.abs(fit.residuals[name]) + (0.0 if sigma is None else sigma)
        if (reach > 0.0).any():
            limit = 1.15 * np.nanmax(reach)
            below.set_ylim(-limit, limit)
        for ax in (above, below):
            ax.grid(True, alpha=0.3, linewidth=0.6)
            ax.spines[["top", "right"]].set_visible(False)
            ax.tick_params(labelsize=LETTERS)
            ax.yaxis.get_offset_text().set_fontsize(LETTERS)
            ax.yaxis.set_major_formatter(PlainOffset())
            ax.ticklabel_format(axis="y", scilimits=(-3, 4))
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=LETTERS,
                   frameon=False, borderaxespad=0.2, handlelength=1.8)  # fmt: skip
    axes[-1].set_xlabel("time [s]", fontsize=LETTERS)
    figure.align_ylabels(axes)
    if fit.result.record.title:
        figure.suptitle(shown_text(fit.result.record.title), fontsize=LETTERS + 1)
    return list(axes)


def _chosen(fit: Fit, outputs: Sequence[str]) -> list[str]:
    for name in outputs:
        if name not in fit.measured:
            raise unknown("output of the fit", name, fit.measured)
    return list(dict.fromkeys(outputs)) or list(fit.measured)
