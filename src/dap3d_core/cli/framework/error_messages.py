"""What goes wrong, in words and as an exit code; a traceback only with ``--debug``."""

import contextlib
import os
import sys
import traceback
from typing import Any

from dap3d_core.cli.console.console import Terminal, messages, plain, print_json, say
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.streams import leave_stderr


def report(error: BaseException, *, debug: bool, as_json: bool) -> int:
    """Tell what went wrong, on stderr and with ``as_json`` as one JSON object on stdout.

    Returns:
        The exit code.
    """
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    code, words = _judge(error)
    mistakes = mistakes_of(error)
    if as_json:
        found: dict[str, Any] = {"error": words, "exit_code": code}
        with contextlib.suppress(OSError):
            print_json({"mistakes": mistakes, **found} if mistakes else found)
    try:
        console = messages()
        if mistakes:
            _tell_mistakes(console, error)
        else:
            say(console, words, "bold red")
        if code == exit_codes.FAILED and not debug and _is_unexpected(error):
            say(console, "run the command again with --debug to see where it happened")
    except OSError:  # stderr is closed or full: the exit code remains
        leave_stderr()
    return code


def mistakes_of(error: BaseException) -> list[dict[str, Any]]:
    """The mistakes of a scene as JSON has them; none for other errors."""
    from dap3d_core.scene import MISSING, SceneError

    if not isinstance(error, SceneError):
        return []
    return [
        {
            "file": m.file,
            "line": m.line,
            "key": m.key,
            "value": None if m.value is MISSING else plain(m.value),
            "what": m.what,
            "nearest": m.nearest,
            "remedy": m.remedy,
        }
        for m in error.mistakes
    ]


def _tell_mistakes(console: Terminal, error: Any) -> None:
    number = len(error.mistakes)
    if number > 1:
        say(console, f"{number} mistakes:", "bold red")
    for line in str(error).split("\n"):
        indented = line.startswith("    ")
        say(console, line.strip(), "" if indented else "red", indent=4 if indented else 0)


def _judge(error: BaseException) -> tuple[int, str]:
    """Exit code and words for an error."""
    from dap3d_core.interface import PluginError
    from dap3d_core.scene import SceneError

    if isinstance(error, KeyboardInterrupt):
        doing = f" {error}" if str(error) else ""
        return exit_codes.INTERRUPTED, f"interrupted{doing}; nothing was computed yet"
    if isinstance(error, exit_codes.Terminated):
        return exit_codes.FAILED, f"{error}; nothing was computed yet"
    if isinstance(error, (SceneError, PluginError, exit_codes.Refused)):
        return exit_codes.REFUSED, str(error)
    if isinstance(error, MemoryError):
        return exit_codes.FAILED, "there is not enough memory for this"
    if _is_unexpected(error):
        words = " ".join(str(error).split())
        return exit_codes.FAILED, f"unexpected {type(error).__name__}" + (
            f": {words}" if words else ""
        )
    if isinstance(error, FileNotFoundError) and _folder_is_gone():
        return (
            exit_codes.REFUSED,
            "the current folder is no longer there; change to another one (cd)",
        )
    if part := getattr(error, "part", None):  # a disk that filled up under a run
        words = f"{error}; what was computed until then is in {part}"
        if checkpoint := getattr(error, "checkpoint", None):
            words += f"; once there is room, dap3d resume {checkpoint} goes on with the run"
        return exit_codes.PARTIAL, words
    if isinstance(error, OSError) and error.strerror:
        file = f"{error.filename}: " if error.filename else ""
        return exit_codes.FAILED, f"cannot read or write: {file}{error.strerror}"
    return exit_codes.FAILED, str(error)


def _folder_is_gone() -> bool:
    """Whether the folder in which the command was given was removed."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _is_unexpected(error: BaseException) -> bool:
    """Whether an error is none of those that the library raises on purpose."""
    if isinstance(error, (OSError, MemoryError, exit_codes.Terminated)):
        return False
    # Asked without importing it: what is broken may be the library itself.
    module = sys.modules.get("dap3d_core.simulation.errors")
    return module is None or not isinstance(error, module.SimulationError)


__all__ = ["mistakes_of", "report"]
