"""Eigenvalues of a linearisation in the complex plane."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.figure_file import save_figure
from dap3d_core.plot.style import HEIGHT, LETTERS, PALETTE, WIDTH, style_axes

if TYPE_CHECKING:
    from dap3d_core.simulation.linearization.linearization import Linearization

#: Eigenvalues whose numbers are written beside them.
MOST_LABELS = 12
#: A real part below this part of the largest magnitude is drawn as zero.
ROUNDING = 1e-9


def save_eigenvalues(
    linearization: "Linearization",
    path: str | os.PathLike[str],
    *,
    width: float = WIDTH,
    height: float = HEIGHT,
    dpi: float = 200.0,
    force: bool = False,
) -> Path:
    """Draw the eigenvalues of a linearisation into a file; needs no display. Returns the path.

    Modes have their numbers; those that grow are drawn as crosses, to the right of the axis.

    Args:
        linearization: the linearisation.
        path: the file; its suffix gives the format, .png, .svg or .pdf.
        width, height: size in inches.
        dpi: dots an inch of a PNG.
        force: overwrites an existing file.

    Raises:
        ValueError: an invalid suffix or size.
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """

    def paint(figure: Figure) -> None:
        draw_eigenvalues(figure.add_subplot(), linearization)

    return save_figure(paint, Path(path), (width, height), dpi, force=force)


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
