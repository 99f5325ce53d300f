"""What goes wrong with results: files that cannot be written or read, names that are not there."""

from collections.abc import Collection

from dap3d_core.registry.suggestions import nearest

#: Up to so many names are listed in a message.
LISTED = 12


class ResultError(OSError):
    """A result cannot be written, read, or made complete; one sentence says why and what helps."""


class UnknownNameError(KeyError):
    """A result has nothing of this name.

    Attributes:
        nearest: the most similar name that it has, or "".
    """

    def __init__(self, words: str, near: str = "") -> None:
        super().__init__(words)
        self.nearest = near

    def __str__(self) -> str:
        return f"{self.args[0]}; did you mean {self.nearest!r}?" if self.nearest else self.args[0]


def unknown(what: str, name: str, known: Collection[str]) -> UnknownNameError:
    """The error for a name that is not among the known ones: lists them where they are few."""
    words = f"there is no {what} {name!r}"
    if not known:
        words += f": the scene has no {what}"
    elif len(known) <= LISTED:
        words += f" ({what}s: {', '.join(known)})"
    return UnknownNameError(words, nearest(name, known))
