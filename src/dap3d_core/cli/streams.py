"""The standard streams, made to never raise for what a user may do to them."""

import contextlib
import os
import sys
from typing import TextIO


def prepare_streams() -> None:
    """Streams that were closed lead nowhere; what an encoding cannot write is escaped."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # also keeps its number from being given to a result file
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def leave_stdout() -> None:
    """Send what is still to come on stdout nowhere, after its reader has gone."""
    _leave(sys.stdout)


def leave_stderr() -> None:
    """The same for stderr that takes nothing: Python would exit with 120 for what is left in it."""
    _leave(sys.stderr)


def _leave(stream: TextIO) -> None:
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
