"""Eigenvalues of a linearisation in the complex plane."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.style import HEIGHT, LETTERS, PALETTE, Picture, style_axes

if TYPE_CHECKING:
    from dap3d_core.simulation.linearization.linearization import Linearization

#: Eigenvalues whose numbers are written beside them.
MOST_LABELS = 12
#: A real part below this part of the largest magnitude is drawn as zero.
ROUNDING = 1e-9


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
