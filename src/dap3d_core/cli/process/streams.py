"""Standard streams that never raise: closed, full, in another encoding, or without a reader."""

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import TextIO

import click

#: Stdout while it is reserved for JSON.
_json_stdout: TextIO | None = None
#: Why stdout cannot be written, such as a full disk; None as long as it can.
_fault: OSError | None = None


def prints_json() -> bool:
    """True if the running command prints one JSON object: --json."""
    return _flag("as_json")


def is_quiet() -> bool:
    """True if the running command prints errors and warnings only: --quiet."""
    return _flag("quiet")


def _flag(name: str) -> bool:
    ctx = click.get_current_context(silent=True)
    return ctx is not None and bool(ctx.meta.get(f"dap3d.{name}"))


def prepare_streams() -> None:
    """Replace closed streams by the null device; escape what an encoding cannot write.

    A width of 0 columns, which some terminals of services set, counts as none.
    """
    global _fault
    _fault = None
    if not os.environ.get("COLUMNS", "1").strip(" 0"):
        del os.environ["COLUMNS"]
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # or a result file would be given the stream's number
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


@contextlib.contextmanager
def reserve_stdout_for_json(*, permanently: bool = False) -> Iterator[None]:
    """Reserve stdout for ``json_stream``; ``permanently``: also while the process ends.

    Other output (of plugins, processes that they start, kernels that print) goes to stderr.
    Streams that are not those of the process are left as they are.
    """
    global _json_stdout
    try:
        ours, number = sys.stdout, sys.stdout.fileno()
        copy = os.dup(number) if number == 1 else -1
    except (AttributeError, ValueError, OSError):
        copy = -1
    if copy < 0:
        yield
        return
    ours.flush()
    with open(copy, "w", encoding=ours.encoding, errors=ours.errors) as stream:
        os.dup2(2, number)
        _json_stdout = stream
        try:
            yield
        finally:
            _json_stdout = None
            with contextlib.suppress(OSError, ValueError):
                ours.flush()
            if not permanently:
                os.dup2(copy, number)


def json_stream() -> TextIO:
    """The stream to which JSON is printed."""
    return _json_stdout or sys.stdout


def leave_stdout(error: OSError | None = None) -> None:
    """Discard further output on stdout; ``error`` is why, unless its reader has gone."""
    global _fault
    if error is not None and not isinstance(error, BrokenPipeError):
        _fault = error
    _discard(json_stream())


def leave_stderr() -> None:
    """Discard further output on stderr, or Python would exit with 120 for what is buffered."""
    _discard(sys.stderr)


def stdout_fault() -> str:
    """Reason why stdout could not be written since ``prepare_streams``; "" if it could."""
    return "" if _fault is None else _fault.strerror or str(_fault)


def _discard(stream: TextIO) -> None:
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
