"""Colours of bodies: those of the scene, else a cycle that colour-blind readers can tell."""

import re
from collections.abc import Iterable, Mapping, Sequence

#: Okabe and Ito (2008), without black and yellow, which drown on one of the two backgrounds.
CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: Names that scenes use, which a browser does not know.
NAMED = {
    "tab:blue": "#1f77b4", "tab:orange": "#ff7f0e", "tab:green": "#2ca02c", "tab:red": "#d62728",
    "tab:purple": "#9467bd", "tab:brown": "#8c564b", "tab:pink": "#e377c2", "tab:gray": "#7f7f7f",
    "tab:olive": "#bcbd22", "tab:cyan": "#17becf",
    "r": "#d62728", "g": "#2ca02c", "b": "#1f77b4", "c": "#17becf", "m": "#c03bc0", "y": "#bcbd22",
    "k": "#404040", "w": "#d8d8d8", "black": "#404040", "white": "#d8d8d8",
}  # fmt: skip
#: Fraction of white in the last link of a chain.
LIGHTEST = 0.55
_WRITTEN = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})|[a-z]{3,24}")


def color(name: object, usual: str) -> str:
    """A colour of a scene as a browser writes it, "#1f77b4" or a word of CSS; else ``usual``."""
    word = name.strip().lower() if isinstance(name, str) else ""
    word = NAMED.get(word, word)
    return word if _WRITTEN.fullmatch(word) else usual


def colors(names: Sequence[object], joints: Iterable[Sequence[int]] = ()) -> list[str]:
    """A colour for each body: its own, or one of the cycle that no body took by name.

    Of more bodies than the cycle has colours, those of a chain of joints have one hue, lighter from
    link to link.

    Args:
        names: colours as the scene names them, of bodies 1, 2, ...
        joints: the bodies that each joint couples.
    """
    given = [color(name, "") for name in names]
    free = [c for c in CYCLE if c not in given] or list(CYCLE)
    unnamed = [k for k, word in enumerate(given, 1) if not word]
    chains = [[k] for k in unnamed] if len(unnamed) <= len(CYCLE) else chains_of(len(given), joints)
    result = list(given)
    for number, chain in enumerate(chains):
        links = [k for k in chain if not given[k - 1]]
        for number_in_chain, k in enumerate(links):
            share = LIGHTEST * number_in_chain / max(1, len(links) - 1)
            result[k - 1] = _lighter(free[number % len(free)], share)
    return result


def chains_of(count: int, joints: Iterable[Sequence[int]]) -> list[list[int]]:
    """Bodies 1 to ``count`` by chains of joints, in the order of their links.

    Chains end where a body has more than two neighbours. Where they are many, as in a net, all
    connected bodies are one chain; bodies without a joint to another are one group.
    """
    near: dict[int, set[int]] = {k: set() for k in range(1, count + 1)}
    for bodies in joints:
        for one in bodies:
            near[one] |= {other for other in bodies if other != one}
    branches = {k for k, others in near.items() if len(others) > 2}
    lone = [k for k, others in near.items() if not others]
    cut = {k: set() if k in branches else near[k] - branches for k in near if k not in lone}
    chains = _connected(cut)
    if len(chains) > len(CYCLE):
        chains = _connected({k: near[k] for k in cut})
    return [*chains, lone] if lone else chains


def _connected(near: Mapping[int, set[int]]) -> list[list[int]]:
    """The connected parts of a graph, each in the order of a walk from an end of it."""
    parts: list[list[int]] = []
    left = dict.fromkeys(sorted(near, key=lambda k: len(near[k])))  # ends first
    while left:
        part, queue = [], [next(iter(left))]
        del left[queue[0]]
        while queue:
            part.append(queue.pop(0))
            for other in sorted(near[part[-1]]):
                if other in left:
                    del left[other]
                    queue.append(other)
        parts.append(part)
    return sorted(parts, key=min)


def _lighter(hue: str, share: float) -> str:
    """A colour of the cycle, mixed with so much white."""
    parts = (int(hue[k : k + 2], 16) for k in (1, 3, 5))
    mixed = (round(part + share * (255 - part)) for part in parts)
    return "#" + "".join(f"{part:02X}" for part in mixed)
