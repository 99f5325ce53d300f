"""Exit codes, and the one exception that is the command line's own."""

#: All went well.
DONE = 0
#: The run failed and left nothing to keep, or something unexpected happened; with --strict, notes.
#: A type whose formulas are wrong.
FAILED = 1
#: Usage, or mistakes in the scene.
REFUSED = 2
#: The run stopped early; what was computed is saved.
PARTIAL = 3
#: Ctrl-C; what was computed is saved.
INTERRUPTED = 130


class Terminated(Exception):  # noqa: N818 - not an error of anyone
    """A signal asks the program to end: SIGTERM, or SIGHUP where a terminal was closed."""


class Refused(Exception):  # noqa: N818 - a verdict, told in a sentence
    """The command cannot be carried out as asked; the message says why and what to do."""
