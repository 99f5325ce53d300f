"""Campbell diagrams and root loci: frequencies and eigenvalues of modes over a parameter."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from dap3d_core.plot.style import (
    DASHES,
    HEIGHT,
    LETTERS,
    PALETTE,
    Picture,
    folded,
    style_axes,
    with_unit,
)

from dap3d_core.plot.sweep.style import LINE_COLORS, norm_of

if TYPE_CHECKING:
    from dap3d_core.study.modes_over import ModesOver

#: The colour of what grows, which no curve has.
GROWS = PALETTE[1]
COLOURS = tuple(colour for colour in PALETTE if colour != GROWS)
#: What is drawn, by name; frequencies by default.
FREQUENCIES, EIGENVALUES = "frequencies", "eigenvalues"
#: A real part below this part of the largest magnitude is drawn as zero.
ROUNDING = 1e-9


def modes_over_picture(
    modes: "ModesOver", names: Sequence[str], x: str | None, at: Mapping[str, float] | None
) -> Picture:
    """The Campbell diagram of modes over a parameter, or their root locus; errors as ``plot``."""
    if list(names) not in ([], [FREQUENCIES], [EIGENVALUES]) or x is not None or at:
        raise ValueError(
            f"of modes over a parameter the {FREQUENCIES} or the {EIGENVALUES} are drawn: name no "
            "more"
        )
    return RootLocusPicture(modes) if EIGENVALUES in names else ModesOverPicture(modes)


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


class RootLocusPicture(Picture):
    """Eigenvalues in the complex plane, coloured by the parameter.

    Circles are those at the first value, squares those at the last one; motions grow to the right
    of the imaginary axis.
    """

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
        size = float(np.nanmax(np.abs(found.eigenvalues), initial=0.0)) or 1.0
        norm, x = norm_of(found.values), found.values
        real = found.eigenvalues.real
        real = np.where(np.abs(real) > ROUNDING * size, real, 0.0)
        imag = found.eigenvalues.imag
        for sign in (1.0, -1.0):
            for re, im in zip(real.T, sign * imag.T, strict=True):
                points = np.column_stack([re, im])
                pieces = np.stack([points[:-1], points[1:]], axis=1)
                colours = 0.5 * (x[:-1] + x[1:])
                lines = LineCollection(pieces, cmap=LINE_COLORS, norm=norm, linewidth=1.6)
                lines.set_array(colours)
                ax.add_collection(lines)
            for row, marker in ((0, "o"), (-1, "s")):
                ax.scatter(real[row], sign * imag[row], marker=marker, s=18.0, linewidth=1.2,
                           facecolor="white", edgecolor=LINE_COLORS(norm(x[row])),
                           zorder=3)  # fmt: skip
        ax.autoscale_view()
        return ax
