"""Style of all plots: sizes, colours, texts, axes, legends."""

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

#: Colours that colour-blind readers can tell apart, on white (Okabe and Ito 2008, without yellow).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Further curves repeat the colours with other dashes.
DASHES = ("-", "--", "-.", ":")
#: A single instant is drawn as markers, which may lie over one another.
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
#: Inches. Letters of 8 points are still 5 points high where the picture is set 60 mm wide.
WIDTH, HEIGHT, PANEL_HEIGHT = 3.8, 2.9, 2.1
LETTERS = 8.0
#: A real part below this part of the largest magnitude is drawn as zero.
REAL_PART_ROUNDING = 1e-9
MINUS = "\N{MINUS SIGN}"
#: Labels of the complex plane of eigenvalues.
REAL_PART, IMAGINARY_PART = "real part [1/s]", "imaginary part [rad/s]"
#: Offsets as matplotlib writes them: 1e-9+4.3e1.
_OFFSET = re.compile(r"(?:1e(-?\d+))?([+-]\d[^+]*)?")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Picture(ABC):
    """Content of a figure."""

    #: The message of those that are never drawn on axes of the user.
    refusal: ClassVar[str] = ""

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT

    @abstractmethod
    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure; returns the axes, without those of colour bars."""

    def draw_on(self, ax: Axes) -> Axes:
        """Draw on axes of the user; a ValueError where the picture has several panels."""
        raise ValueError(self.refusal)


class StackedPanels(Picture):
    """A picture of panels below one another over one x axis."""

    panels: Any

    @property
    def height(self) -> float:
        """A suitable height of the figure, inches."""
        return HEIGHT if len(self.panels) == 1 else PANEL_HEIGHT * len(self.panels)

    def axes_on(self, figure: Figure) -> tuple[list[Axes], float, float]:
        """Axes of the panels on an empty figure; width and height of each, inches."""
        axes = figure.subplots(len(self.panels), 1, sharex=True, squeeze=False)[:, 0]
        return list(axes), figure.get_figwidth(), figure.get_figheight() / len(axes)


class OnePanel(Picture):
    """A picture of one panel, which is drawn on axes."""

    def draw(self, figure: Figure) -> list[Axes]:
        """Draw on an empty figure; returns its axes."""
        return [self.draw_on(figure.add_subplot())]


class PlainOffset(ScalarFormatter):
    """Shows factor and offset of the numbers of an axis as ``×10⁻⁹ + 43``."""

    def get_offset(self) -> str:
        """The text at the end of the axis."""
        text = str(super().get_offset())
        match = _OFFSET.fullmatch(text.replace(MINUS, "-"))
        if match is None:
            return text
        power, added = match.groups()
        words = [f"×10{power.translate(_RAISED)}"] if power else []
        if added:
            words.append(f"{MINUS if added[0] == '-' else '+'} {abs(float(added)):.12g}")
        return " ".join(words)


def show_rounding_flat(ax: Axes, span: float = 0.0) -> None:
    """Choose limits in which curves that differ by rounding alone are level.

    The axis spans ``span`` or more.
    """
    low, high = ax.dataLim.intervaly
    size = max(abs(low), abs(high))
    if 0.0 < high - low < 1e-12 * size:
        span = max(span, 0.2 * size)
    if high - low < span:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.55 * span, middle + 0.55 * span)


def style_axes(
    ax: Axes, x_label: str | None = None, y_label: str | None = None, *, grid: bool = True
) -> None:
    """Set labels, sizes of letters, a pale grid, and no frame above and to the right."""
    if x_label is not None:
        ax.set_xlabel(x_label, fontsize=LETTERS)
    if y_label is not None:
        ax.set_ylabel(y_label, fontsize=LETTERS)
    ax.tick_params(labelsize=LETTERS)
    for offset in (ax.xaxis.get_offset_text(), ax.yaxis.get_offset_text()):
        offset.set_fontsize(LETTERS)
    ax.yaxis.get_offset_text().set_horizontalalignment("right")  # beside a legend above the axes
    if grid:
        ax.grid(True, alpha=0.3, linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)


def legend_above(ax: Axes, names: Sequence[str], width: float) -> None:
    """Draw the legend of axes of a width (inches) above them, in as many columns as fit."""
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns_of(names, width - 0.6),
              fontsize=LETTERS, labelspacing=0.25, frameon=False, borderaxespad=0.2,
              handlelength=1.8, columnspacing=1.0, handletextpad=0.5)  # fmt: skip


def legend_below(
    figure: Figure, handles: Sequence[Any], columns: int, line_length: float = 1.8
) -> None:
    """Draw a legend of handles that have labels at the foot of a figure."""
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns,
                  fontsize=LETTERS, frameon=False, handlelength=line_length,
                  columnspacing=1.0, borderaxespad=0.1)  # fmt: skip


def columns_of(labels: Sequence[str], width: float) -> int:
    """Number of columns of a legend that fit a width, inches: letters, line, gap."""
    column = (0.56 * max(map(len, labels)) + 4.0) * LETTERS / 72.0
    rows = -(-len(labels) // max(1, int(width / column)))
    return -(-len(labels) // rows)


def with_unit(words: str, unit: str) -> str:
    """A label and the unit, [1] for numbers without one."""
    return shown_text(f"{words} {unit_text(unit)}".strip())


def unit_text(unit: str) -> str:
    """A unit as figures show it, in brackets; lines are not broken within."""
    if unit == "SI":  # it depends on the row
        return "(SI\N{NO-BREAK SPACE}units)"
    shown = unit.replace("^2", "²").replace("^3", "³").replace(" ", "\N{NO-BREAK SPACE}")
    return f"[{shown}]" if unit else ""


def shown_text(words: str) -> str:
    """Text that matplotlib shows as it is: a $ begins no formula, a _ hides no curve.

    Characters that no font draws, such as control characters, are left out.
    """
    kept = "\N{NO-BREAK SPACE}"
    words = "".join(c if c.isprintable() or c == kept else " " for c in words).replace("$", r"\$")
    return f" {words}" if words.startswith("_") else words


def folded(words: str, room: float) -> str:
    """Text in lines of so many characters; names break behind a dot, a colon or an underline."""
    room = max(12, int(room))
    lines = [""]
    for part in re.findall(r"[^ ._:]*[ ._:]?", words):
        for piece in (part[k : k + room] for k in range(0, len(part), room)):
            if len((lines[-1] + piece).rstrip()) > room and lines[-1]:
                lines.append("")
            lines[-1] += piece
    return "\n".join(line.strip() for line in lines)
