"""Bands behind curves of contacts: where one slides, and where it sticks."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from dap3d_core.plot.style import LETTERS
from dap3d_core.result import Quantity, Result
from dap3d_core.result.post.contact_output import POINT

#: Mode -> word and colour; open contacts have the colour of the page.
LOOKS = {1: ("slides", "#F6D9B8"), 2: ("sticks", "#CFE5CF")}
#: Parts of the width of a panel from which on a band has its word, upright and as written.
ROOM, ENOUGH = 0.04, 0.16


class Band(NamedTuple):
    """A contact is in a mode from one instant to another, s."""

    start: float
    end: float
    mode: int


def bands_of(result: Result, quantities: Iterable[Quantity]) -> list[Band]:
    """The bands of the contact of some quantities; none where they are of two or more, or none.

    A contact with several points sticks where one of them does. Between two reports a change is at
    the last event there.
    """
    heads = {q.name.split(".")[0] for q in quantities if q.owner == "contact"}
    if len(heads) != 1 or len(result.t) < 2:
        return []
    (name,) = heads
    modes: Any = np.asarray(result.contact(name).mode, dtype=float)
    modes = modes.reshape(len(result.t), -1).max(axis=1)
    if not np.isfinite(modes).all():
        return []
    cuts = [float(result.t[0])]
    for before, after in pairwise(range(len(modes))):
        if modes[before] != modes[after]:
            first, last = float(result.t[before]), float(result.t[after])
            found = [e.t for e in result.events
                     if e.name.split(POINT)[0] == name.split(POINT)[0] and first <= e.t <= last]  # fmt: skip
            cuts.append(found[-1] if found else 0.5 * (first + last))
    cuts.append(float(result.t[-1]))
    kept = [modes[0], *(b for a, b in pairwise(modes) if a != b)]
    return [Band(a, b, int(mode)) for (a, b), mode in zip(pairwise(cuts), kept, strict=True)]


def shade(ax: Axes, bands: Sequence[Band]) -> None:
    """Draw bands behind the curves, each mode with its word in its widest band."""
    width = bands[-1].end - bands[0].start if bands else 0.0
    for mode, (word, color) in LOOKS.items():
        alike = [band for band in bands if band.mode == mode]
        for band in alike:
            ax.axvspan(band.start, band.end, color=color, linewidth=0.0, zorder=0.0)
        widest = max(alike, key=lambda band: band.end - band.start, default=None)
        room = widest.end - widest.start if widest is not None else 0.0
        if widest is not None and room > ROOM * width:
            ax.text(
                0.5 * (widest.start + widest.end), 0.5, word, transform=ax.get_xaxis_transform(),
                rotation=0 if room > ENOUGH * width else 90, ha="center", va="center",
                fontsize=LETTERS, color="#444444",
            )  # fmt: skip
