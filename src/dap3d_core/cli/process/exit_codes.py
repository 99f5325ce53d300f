"""Exit codes, and the exceptions that the command line itself raises."""

from collections.abc import Iterator
from contextlib import contextmanager

#: Success.
DONE = 0
#: Failure without a result, unexpected error, warnings with --strict, type with wrong formulas.
FAILED = 1
#: Wrong usage, or mistakes in the scene.
REFUSED = 2
#: The run stopped early; what was computed is saved.
PARTIAL = 3
#: Ctrl-C; what was computed is saved.
INTERRUPTED = 130


class Terminated(Exception):  # noqa: N818 - a request, not an error
    """A signal requests the end of the program: SIGTERM, or SIGHUP of a closed terminal."""


class Refused(Exception):  # noqa: N818 - the user's mistake, not the program's
    """Invalid request; the message says why, and what to do."""


@contextmanager
def refusing(*errors: type[Exception]) -> Iterator[None]:
    """Turns errors of these types into ``Refused`` with the same message."""
    try:
        yield
    except errors as error:
        raise Refused(str(error)) from error
