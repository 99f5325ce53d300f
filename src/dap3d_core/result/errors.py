"""Errors of results: files that cannot be written or read, unknown names."""

from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.registry.suggestions import nearest

#: Largest number of names listed in a message.
LISTED = 12


class ResultError(OSError):
    """A result cannot be written, read, or completed; the message gives reason and remedy."""


class UnknownNameError(KeyError):
    """A result has nothing of this name.

    Attributes:
        nearest: the most similar name that it has, or "".
    """

    def __init__(self, message: str, near: str = "") -> None:
        super().__init__(message)
        self.nearest = near

    def __str__(self) -> str:
        return f"{self.args[0]}; did you mean {self.nearest!r}?" if self.nearest else self.args[0]


def unknown(what: str, name: str, known: Collection[str]) -> UnknownNameError:
    """The error for a name that is not known; lists the known ones if they are few."""
    message = f"there is no {what} {name!r}"
    if not known:
        message += f": the scene has no {what}"
    elif len(known) <= LISTED:
        several = f"{what[:-1]}ies" if what.endswith("y") else f"{what}s"
        several = "known" if " or " in what else several
        message += f" ({several}: {', '.join(known)})"
    return UnknownNameError(message, nearest(name, known))


@attrs.frozen(eq=False)
class Computed:
    """What was computed until an exception: attributes of the exception, each perhaps None.

    Attributes:
        result: the result, or the data of a study.
        checkpoint: the file from which the run can be resumed.
        part: the file of a run whose disk is full.
        report: the report of methods, as far as it came.
    """

    result: Any = None
    checkpoint: Path | None = None
    part: Path | None = None
    report: Any = None

    @classmethod
    def of(cls, error: BaseException) -> "Computed":
        """What an exception carries."""
        return cls(*(getattr(error, one.name, None) for one in attrs.fields(cls)))

    def attach(self, error: BaseException) -> None:
        """Make an exception of any class carry it, besides what it carries already."""
        with suppress(AttributeError):  # of a class with slots
            for name, value in attrs.asdict(self, recurse=False).items():
                if value is not None or not hasattr(error, name):
                    setattr(error, name, value)
