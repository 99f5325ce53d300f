"""Numbers beside an axis that a reader can add up, and limits that do not enlarge rounding."""

import re

from matplotlib.axes import Axes
from matplotlib.ticker import ScalarFormatter

#: A range below this part of the values is their rounding.
ROUNDING = 1e-12
MINUS = "\N{MINUS SIGN}"
#: What matplotlib writes there: 1e-9+4.3e1.
_OFFSET = re.compile(r"(?:1e(-?\d+))?([+-]\d[^+]*)?")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class PlainOffset(ScalarFormatter):
    """Says what the numbers of an axis are times, and what is to be added: ``×10⁻⁹ + 43``."""

    def get_offset(self) -> str:
        """The words at the end of the axis."""
        text = str(super().get_offset())
        match = _OFFSET.fullmatch(text.replace(MINUS, "-"))
        if match is None:
            return text
        power, added = match.groups()
        words = [f"×10{power.translate(_RAISED)}"] if power else []
        if added:
            words.append(f"{MINUS if added[0] == '-' else '+'} {abs(float(added)):.12g}")
        return " ".join(words)


def show_rounding_flat(ax: Axes) -> None:
    """Where curves differ by rounding alone, choose limits in which they are level."""
    low, high = ax.dataLim.intervaly
    size = max(abs(low), abs(high))
    if 0.0 < high - low < ROUNDING * size:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.1 * size, middle + 0.1 * size)
