"""Plot of a fit: measured points, the curve of the fitted run, and their differences."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.curves import rate_of, smooth
from dap3d_core.plot.style import (
    LETTERS,
    PALETTE,
    Picture,
    PlainOffset,
    folded,
    legend_above,
    shown_text,
    style_axes,
    unit_text,
    with_unit,
)
from dap3d_core.result import find
from dap3d_core.result.errors import unknown
from dap3d_core.study.fit.fit_result import Fit

#: Inches: of a panel with points and curve, and of the one with residuals below it.
CURVE_HEIGHT, RESIDUAL_HEIGHT = 1.7, 0.9


@attrs.frozen(eq=False)
class FitPicture(Picture):
    """Outputs of a fit, each with its residuals below."""

    fit: Fit
    outputs: list[str]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return 0.6 + (CURVE_HEIGHT + RESIDUAL_HEIGHT) * len(self.outputs)

    def draw_on(self, ax: Axes) -> Axes:
        """Refuse: a fit has two panels or more."""
        raise ValueError("a fit is drawn over time, on a figure of its own: leave x, ax out")

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure; returns the axes."""
        ratios = [CURVE_HEIGHT, RESIDUAL_HEIGHT] * len(self.outputs)
        axes = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        for name, above, below in zip(self.outputs, axes[::2], axes[1::2], strict=True):
            self._draw_output(name, above, below)
            for ax in (above, below):
                style_axes(ax)
                ax.yaxis.set_major_formatter(PlainOffset())
                ax.ticklabel_format(axis="y", scilimits=(-3, 4))
        legend_above(axes[0], ("measured", "fitted"), figure.get_figwidth())
        axes[-1].set_xlabel("time [s]", fontsize=LETTERS)
        figure.align_ylabels(axes)
        if self.fit.result.record.title:
            figure.suptitle(shown_text(self.fit.result.record.title), fontsize=LETTERS + 1)
        return list(axes)

    def _draw_output(self, name: str, above: Axes, below: Axes) -> None:
        fit, t = self.fit, self.fit.result.t
        curve = find(fit.result, fit.quantities[name])
        points = smooth(fit.result, t, curve.values, np.ones(len(t)), rate_of(fit.result, curve))
        marks: Any = dict(color=PALETTE[1], linestyle="none", marker="o", markersize=2.5,
                          markeredgewidth=0.0, alpha=0.7)  # fmt: skip
        above.plot(fit.t, fit.measured[name], label="measured", **marks)
        above.plot(*points, color=PALETTE[0], linewidth=1.2, label="fitted")
        label = folded(with_unit(curve.label, curve.unit), 15 * CURVE_HEIGHT)
        above.set_ylabel(label, fontsize=LETTERS)
        sigma, residuals = fit.sigma.get(name), fit.residuals[name]
        if sigma is None:
            below.plot(fit.t, residuals, **marks)
        else:
            below.errorbar(fit.t, residuals, sigma, elinewidth=0.5, **marks)
        below.axhline(0.0, color=PALETTE[0], linewidth=1.0)
        below.set_ylabel(f"residual\n{unit_text(curve.unit)}", fontsize=LETTERS)
        reach = np.abs(residuals) + (0.0 if sigma is None else sigma)
        if (reach > 0.0).any():
            limit = 1.15 * np.nanmax(reach)
            below.set_ylim(-limit, limit)


def fit_picture(fit: Fit, outputs: Sequence[str]) -> FitPicture:
    """Picture of outputs of a fit, by default of all; unknown ones are an UnknownNameError."""
    for name in outputs:
        if name not in fit.measured:
            raise unknown("output of the fit", name, fit.measured)
    return FitPicture(fit, list(dict.fromkeys(outputs)) or list(fit.measured))
