"""The standard streams, made to never raise for what a user may do to them."""

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import TextIO

#: Stdout while it is kept for JSON.
_alone: TextIO | None = None
#: Why stdout takes nothing any more, such as a full disk; None as long as it does.
_fault: OSError | None = None


def prepare_streams() -> None:
    """Streams that were closed lead nowhere; what an encoding cannot write is escaped.

    A width of no columns, which some terminals of services give, counts as none.
    """
    global _fault
    _fault = None
    if not os.environ.get("COLUMNS", "1").strip(" 0"):
        del os.environ["COLUMNS"]
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # also keeps its number from being given to a result file
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


@contextlib.contextmanager
def json_alone(*, to_the_end: bool = False) -> Iterator[None]:
    """Stdout for ``json_stream`` alone.

    What others write there (plugins, processes that they start, kernels that print) goes to stderr.
    Streams that are not those of the process stay as they are.

    Args:
        to_the_end: it stays so afterwards, for what is written when the process ends.
    """
    global _alone
    try:
        ours, number = sys.stdout, sys.stdout.fileno()
        kept = os.dup(number) if number == 1 else -1
    except (AttributeError, ValueError, OSError):
        kept = -1
    if kept < 0:
        yield
        return
    ours.flush()
    with open(kept, "w", encoding=ours.encoding, errors=ours.errors) as stream:
        os.dup2(2, number)
        _alone = stream
        try:
            yield
        finally:
            _alone = None
            with contextlib.suppress(OSError, ValueError):
                ours.flush()
            if not to_the_end:
                os.dup2(kept, number)


def json_stream() -> TextIO:
    """Where a JSON object is printed."""
    return _alone or sys.stdout


def leave_stdout(error: OSError | None = None) -> None:
    """Send what is still to come on stdout nowhere, after its reader has gone or it has failed.

    Args:
        error: how it has failed, for ``stdout_fault``.
    """
    global _fault
    if error is not None and not isinstance(error, BrokenPipeError):
        _fault = error
    _leave(json_stream())


def leave_stderr() -> None:
    """The same for stderr that takes nothing: Python would exit with 120 for what is left in it."""
    _leave(sys.stderr)


def stdout_fault() -> str:
    """Why stdout could not be written since ``prepare_streams``; "" where it could."""
    return "" if _fault is None else _fault.strerror or str(_fault)


def _leave(stream: TextIO) -> None:
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
