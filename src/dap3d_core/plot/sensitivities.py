"""Elasticities as bars, and derivatives over time as curves."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dap3d_core.plot.style import LETTERS, PALETTE, PANEL_HEIGHT, Picture, style_axes

if TYPE_CHECKING:
    from dap3d_core.study.sensitivities.sensitivities import Sensitivities


class SensitivityPicture(Picture):
    """For each quantity its elasticities at the end, and p dq/dp over time.

    Attributes:
        sensitivities: of the run.
        quantities: scalar ones, by name.
    """

    def __init__(self, sensitivities: "Sensitivities", quantities: tuple[str, ...]) -> None:
        self.sensitivities, self.quantities = sensitivities, quantities

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return PANEL_HEIGHT * len(self.quantities)

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        found = self.sensitivities
        panels = figure.subplots(len(self.quantities), 2, squeeze=False)
        for (bars, curves), quantity in zip(panels, self.quantities, strict=True):
            elasticities = np.nan_to_num(found.elasticities(quantity), posinf=0.0, neginf=0.0)
            colors = [PALETTE[k % len(PALETTE)] for k in range(len(found.names))]
            bars.barh(list(found.names), elasticities, color=colors)
            bars.invert_yaxis()
            bars.axvline(0.0, color="0.5", linewidth=0.8)
            bars.set_xlabel(f"% of {quantity} by 1 %", fontsize=LETTERS)
            for k, curve in enumerate((found.of(quantity) * found.values).T):
                curves.plot(found.result.t, curve, color=colors[k], linewidth=1.2)
            curves.set_xlabel("t [s]", fontsize=LETTERS)
            curves.set_ylabel(f"p d {quantity} / dp", fontsize=LETTERS)
        axes = [one for row in panels for one in row]
        for one in axes:
            style_axes(one)
        return axes

    def draw_on(self, ax: Axes) -> Axes:
        """Refuse: there are several panels."""
        raise ValueError("sensitivities have several panels: leave ax out")
