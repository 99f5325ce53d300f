"""Frequency responses: gain and phase over frequency."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.plot.style import DASHES, LETTERS, PALETTE, PANEL_HEIGHT, Picture, style_axes

#: Quarter turns have ticks of the phase.
QUARTER = 90.0


class BodePicture(Picture):
    """Gain and phase of each output over each input, on logarithmic axes.

    Attributes:
        frequencies: (f,) Hz.
        response: (f, outputs, inputs).
        inputs, outputs: their names.
    """

    def __init__(
        self,
        frequencies: Floats,
        response: NDArray[np.complex128],
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
    ) -> None:
        self.frequencies, self.response = frequencies, response
        self.inputs, self.outputs = inputs, outputs

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return 2.0 * PANEL_HEIGHT

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        gain, phase = figure.subplots(2, 1, sharex=True)
        pairs = [(j, i) for j in range(len(self.outputs)) for i in range(len(self.inputs))]
        for n, (j, i) in enumerate(pairs):
            values = self.response[:, j, i]
            finite = np.isfinite(values)
            style = {"color": PALETTE[n % len(PALETTE)], "linewidth": 1.2,
                     "linestyle": DASHES[n // len(PALETTE) % len(DASHES)]}  # fmt: skip
            label = f"{self.outputs[j]} / {self.inputs[i]}"
            gain.plot(
                self.frequencies, np.where(finite, np.abs(values), np.nan), label=label, **style
            )
            angle = np.degrees(np.unwrap(np.angle(values[finite])))
            phase.plot(self.frequencies[finite], angle, **style)
        gain.set_xscale("log")
        if np.any(np.abs(self.response[np.isfinite(self.response)]) > 0.0):
            gain.set_yscale("log")
        gain.set_ylabel("gain", fontsize=LETTERS)
        phase.set_ylabel("phase [deg]", fontsize=LETTERS)
        phase.set_xlabel("frequency [Hz]", fontsize=LETTERS)
        low, high = phase.get_ylim()
        if high - low > QUARTER:
            phase.set_yticks(np.arange(np.ceil(low / QUARTER), high / QUARTER) * QUARTER)
        for axes in (gain, phase):
            style_axes(axes)
        gain.legend(fontsize=LETTERS, frameon=False)
        return [gain, phase]

    def draw_on(self, ax: Axes) -> Axes:
        """Refuse: there are two panels."""
        raise ValueError("a frequency response has two panels, gain and phase: leave ax out")
