"""The command line: each command makes one call of the library and presents the result."""

from collections.abc import Sequence
from typing import NoReturn

__all__ = ["main"]

#: New objects until garbage is collected: what commands import and compile, some 100,000, is none.
COLLECT_AFTER = 200_000


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Args:
        argv: the words after ``dap3d``; by default those of the process.
    """
    import gc
    import sys

    try:  # Ctrl-C may come before anything is loaded
        if argv is None:
            gc.set_threshold(COLLECT_AFTER, *gc.get_threshold()[1:])
        from dap3d_core.cli.app import run_line

        code = run_line(argv)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        code = 130
    finally:
        if argv is None:
            gc.freeze()  # the process ends: its last collections would go through all there is
    if argv is None and code == 130:
        _leave(code)
    return code


def _leave(code: int) -> NoReturn:
    """End the process without taking the interpreter down.

    That aborts it where Ctrl-C has stopped the import of a package of compiled code half way.
    """
    import atexit
    import contextlib
    import os
    import sys

    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)
