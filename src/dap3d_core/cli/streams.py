"""The standard streams, made to never raise for what a user may do to them."""

import contextlib
import os
import sys


def print_anything() -> None:
    """Names that the terminal's encoding cannot write are escaped instead of raising."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def leave_stdout() -> None:
    """Send what is still to come on stdout nowhere, after its reader has gone."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
