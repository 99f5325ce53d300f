"""Campbell diagrams and root loci: frequencies and eigenvalues of modes over a parameter."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import attrs
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.plot import style
from dap3d_core.plot.sweep.panels import LINE_COLORS, norm_of

if TYPE_CHECKING:
    from dap3d_core.simulation.linearization.state_matrices import Complex
    from dap3d_core.study.modes_over import ModesOver

#: The colour of what grows, which no curve has.
GROWS = style.PALETTE[1]
COLOURS = tuple(colour for colour in style.PALETTE if colour != GROWS)
#: What is drawn, by name; frequencies by default.
FREQUENCIES, EIGENVALUES = "frequencies", "eigenvalues"
#: Points of a curve on which a pair meets the real axis.
MEETING = 24


def modes_over_picture(
    modes: "ModesOver", names: Sequence[str], x: str | None, at: Mapping[str, float] | None
) -> style.Picture:
    """The Campbell diagram of modes over a parameter, or their root locus; errors as ``plot``."""
    if list(names) not in ([], [FREQUENCIES], [EIGENVALUES]) or x is not None or at:
        raise ValueError(
            f"of modes over a parameter the {FREQUENCIES} or the {EIGENVALUES} are drawn: name no "
            "more"
        )
    return RootLocusPicture(modes) if EIGENVALUES in names else ModesOverPicture(modes)


@attrs.frozen(eq=False)
class ModesOverPicture(style.OnePanel):
    """Frequency of each mode over the parameter; crosses where its motion grows."""

    modes: "ModesOver"

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user."""
        found = self.modes
        x, f, grows = found.values, found.frequencies, found.grows
        for k in range(f.shape[1]):
            ax.plot(x, f[:, k], color=COLOURS[k % len(COLOURS)], linewidth=1.2,
                    linestyle=style.DASHES[k // len(COLOURS) % len(style.DASHES)])  # fmt: skip
        if np.any(grows):
            row, mode = np.nonzero(grows)
            ax.plot(x[row], f[row, mode], "X", color=GROWS, markersize=4.5, linestyle="",
                    label="grows")  # fmt: skip
            ax.legend(fontsize=style.LETTERS, frameon=False)
        ax.set_ylim(bottom=0.0)
        style.style_axes(ax, style.with_unit(found.parameter, found.unit), "frequency [Hz]")
        return ax


@attrs.frozen(eq=False)
class RootLocusPicture(style.OnePanel):
    """Eigenvalues in the complex plane, coloured by the parameter.

    Circles are those at the first value, squares those at the last one; motions grow on the tinted
    side.
    """

    modes: "ModesOver"

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        ax = figure.add_subplot()
        bar = figure.colorbar(self._draw_lines(ax), ax=ax, pad=0.02)
        bar.ax.tick_params(labelsize=style.LETTERS)
        label = style.with_unit(self.modes.parameter, self.modes.unit)
        bar.set_label(style.folded(label, 15 * figure.get_figheight()), fontsize=style.LETTERS)
        _, labels = ax.get_legend_handles_labels()
        style.legend_above(ax, labels, figure.get_figwidth())
        return [ax]

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user."""
        self._draw_lines(ax)
        ax.legend(fontsize=style.LETTERS, frameon=False)
        return ax

    def _draw_lines(self, ax: Axes) -> LineCollection:
        found, x = self.modes, self.modes.values
        values = np.where(np.isnan(found.eigenvalues), complex(np.nan, np.nan), found.eigenvalues)
        size = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
        values.real[np.abs(values.real) <= style.REAL_PART_ROUNDING * size] = 0.0
        norm = norm_of(x)
        curves = list(_loci(x, values))
        points = [np.column_stack([z.real, z.imag]) for _, z in curves]
        pieces = [np.stack([one[:-1], one[1:]], axis=1) for one in points]
        colours = [0.5 * (over[:-1] + over[1:]) for over, _ in curves]
        segments = list(np.concatenate([np.zeros((0, 2, 2)), *pieces]))
        lines = LineCollection(segments, cmap=LINE_COLORS, norm=norm, linewidth=1.6)
        lines.set_array(np.concatenate([x[:0], *colours]))
        for row, marker, label in ((0, "o", "first value"), (-1, "s", "last value")):
            ends = np.concatenate([values[row], values[row].conj()])
            ax.plot(ends.real, ends.imag, marker, color=LINE_COLORS(norm(x[row])), linestyle="",
                    markerfacecolor="white", markersize=4.5, label=label)  # fmt: skip
        ax.add_collection(lines)
        ax.autoscale_view()
        if not np.any(values.real[np.isfinite(values)]):
            ax.set_xlim(-size, size)
        ax.margins(0.08)
        ax.axvline(0.0, color="0.6", linewidth=0.8, zorder=0)
        left, right = ax.get_xlim()
        if right > 0.0:
            ax.axvspan(0.0, right, color=GROWS, alpha=0.08, linewidth=0.0, zorder=0)
            ax.set_xlim(left, right)
        style.style_axes(ax, style.REAL_PART, style.IMAGINARY_PART)
        return lines


def _loci(x: Floats, values: "Complex") -> Iterator[tuple[Floats, "Complex"]]:
    """Values of the parameter and eigenvalues of each piece of a locus.

    Args:
        x: (n,) the parameter.
        values: (n, modes) eigenvalues, of pairs that with Im > 0; NaN where there is no such mode.
    """
    for k in range(len(x) - 1):
        over = x[k : k + 2]
        for before, after, forward in ((values[k], values[k + 1], True),
                                       (values[k + 1], values[k], False)):  # fmt: skip
            for pair, reals in _meetings(before, after):
                parts, both = _meeting(before[pair], after[reals])
                along = over[0] + np.diff(over) * (parts if forward else 1.0 - parts)
                for z in both:
                    yield along, z
        is_pair = values[k : k + 2].imag != 0.0
        is_there = np.all(np.isfinite(values[k : k + 2]), axis=0)
        for z in values[k : k + 2, is_there & (is_pair[0] == is_pair[1])].T:
            yield over, z
            if z[0].imag:
                yield over, z.conj()


def _meetings(before: "Complex", after: "Complex") -> Iterator[tuple[int, list[int]]]:
    """Pairs that meet on the real axis, and the two eigenvalues that they leave it as."""
    begun = [int(j) for j in np.flatnonzero(np.isnan(before) & (after.imag == 0.0))]
    for k in np.flatnonzero((before.imag > 0.0) & (after.imag == 0.0)):
        if begun:
            j = min(begun, key=lambda j: abs(after[j] + after[k] - 2.0 * before[k].real))
            begun.remove(j)
            yield int(k), [int(k), j]


def _meeting(pair: complex, reals: "Complex") -> tuple[Floats, list["Complex"]]:
    """Parts of the step from a pair to two real eigenvalues, and both eigenvalues there.

    Mean and squared half difference of both are smooth, and are taken for linear.
    """
    below, above = pair.imag**2, (0.5 * np.ptp(reals.real)) ** 2
    parts = np.sort(np.append(np.linspace(0.0, 1.0, MEETING), below / (below + above)))
    mean = pair.real + parts * (np.mean(reals.real) - pair.real)
    square = parts * above - (1.0 - parts) * below
    square[np.abs(square) <= style.REAL_PART_ROUNDING * (below + above)] = 0.0
    root = np.sqrt(square.astype(complex))
    return parts, [mean + root, mean - root]


@attrs.frozen(eq=False)
class BodePicture(style.Picture):
    """Gain and phase of each output over each input, on logarithmic axes.

    Attributes:
        frequencies: (f,) Hz.
        response: (f, outputs, inputs).
        inputs, outputs: their names.
    """

    refusal = "a frequency response has two panels, gain and phase: leave ax out"

    frequencies: Floats
    response: NDArray[np.complex128]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return 2.0 * style.PANEL_HEIGHT

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure."""
        gain, phase = figure.subplots(2, 1, sharex=True)
        pairs = [(j, i) for j in range(len(self.outputs)) for i in range(len(self.inputs))]
        for n, (j, i) in enumerate(pairs):
            values = self.response[:, j, i]
            finite = np.isfinite(values)
            round_, color = divmod(n, len(style.PALETTE))
            look = {"color": style.PALETTE[color], "linewidth": 1.2,
                    "linestyle": style.DASHES[round_ % len(style.DASHES)]}  # fmt: skip
            label = f"{self.outputs[j]} / {self.inputs[i]}"
            gain.plot(
                self.frequencies, np.where(finite, np.abs(values), np.nan), label=label, **look
            )
            angle = np.degrees(np.unwrap(np.angle(values[finite])))
            phase.plot(self.frequencies[finite], angle, **look)
        gain.set_xscale("log")
        if np.any(np.abs(self.response[np.isfinite(self.response)]) > 0.0):
            gain.set_yscale("log")
        low, high = phase.get_ylim()
        if high - low > 90.0:  # ticks at quarter turns
            phase.set_yticks(np.arange(np.ceil(low / 90.0), high / 90.0) * 90.0)
        style.style_axes(gain, y_label="gain")
        style.style_axes(phase, "frequency [Hz]", "phase [deg]")
        gain.legend(fontsize=style.LETTERS, frameon=False)
        return [gain, phase]
