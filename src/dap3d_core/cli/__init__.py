"""The command line: each command makes one call of the library and presents the result."""

from collections.abc import Sequence

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Args:
        argv: the words after ``dap3d``; by default those of the process.
    """
    import sys

    try:  # Ctrl-C may come before anything is loaded
        from dap3d_core.cli.app import run_line

        return run_line(argv)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
