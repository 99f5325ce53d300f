"""Campbell diagrams: frequencies of modes over a parameter."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.style import (
    DASHES,
    HEIGHT,
    LETTERS,
    PALETTE,
    Picture,
    style_axes,
    with_unit,
)

if TYPE_CHECKING:
    from dap3d_core.study.modes_over import ModesOver

#: The colour of what grows, which no curve has.
GROWS = PALETTE[1]
COLOURS = tuple(colour for colour in PALETTE if colour != GROWS)


class ModesOverPicture(Picture):
    """Frequency of each mode over the parameter; crosses where its motion grows."""

    def __init__(self, modes: "ModesOver") -> None:
        self.modes = modes

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        return [self.draw_on(figure.add_subplot())]

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user."""
        found = self.modes
        x, f, grows = found.values, found.frequencies, found.grows
        for k in range(f.shape[1]):
            ax.plot(x, f[:, k], color=COLOURS[k % len(COLOURS)], linewidth=1.2,
                    linestyle=DASHES[k // len(COLOURS) % len(DASHES)])  # fmt: skip
        if np.any(grows):
            row, mode = np.nonzero(grows)
            ax.plot(x[row], f[row, mode], "X", color=GROWS, markersize=4.5, linestyle="",
                    label="grows")  # fmt: skip
            ax.legend(fontsize=LETTERS, frameon=False)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel(with_unit(found.parameter, found.unit), fontsize=LETTERS)
        ax.set_ylabel("frequency [Hz]", fontsize=LETTERS)
        style_axes(ax)
        return ax
