"""Colours of bodies: those the scene names, else a cycle that colour-blind readers can tell."""

import re
from collections.abc import Iterable

#: Okabe and Ito (2008), without black and yellow, which drown on one of the two backgrounds.
CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: Names that scenes use, which a browser does not know.
NAMED = {
    "tab:blue": "#1f77b4",
    "tab:orange": "#ff7f0e",
    "tab:green": "#2ca02c",
    "tab:red": "#d62728",
    "tab:purple": "#9467bd",
    "tab:brown": "#8c564b",
    "tab:pink": "#e377c2",
    "tab:gray": "#7f7f7f",
    "tab:olive": "#bcbd22",
    "tab:cyan": "#17becf",
    "r": "#d62728",
    "g": "#2ca02c",
    "b": "#1f77b4",
    "c": "#17becf",
    "m": "#c03bc0",
    "y": "#bcbd22",
    "k": "#404040",
    "w": "#d8d8d8",
    "black": "#404040",
    "white": "#d8d8d8",
}
_WRITTEN = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})|[a-z]{3,24}")


def color(name: object, usual: str) -> str:
    """A colour as a browser writes it: "#1f77b4", or a word of CSS.

    Args:
        name: as a scene writes it; what is no colour counts as none.
        usual: the colour where the name says nothing.
    """
    word = name.strip().lower() if isinstance(name, str) else ""
    word = NAMED.get(word, word)
    return word if _WRITTEN.fullmatch(word) else usual


def colors(names: Iterable[object]) -> list[str]:
    """A colour for each body: its own, or the next of the cycle that no body took by name."""
    given = [color(name, "") for name in names]
    free = [c for c in CYCLE if c not in given] or list(CYCLE)
    found, used = [], 0
    for word in given:
        found.append(word or free[used % len(free)])
        used += not word
    return found
