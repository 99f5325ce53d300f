"""Error messages with their exit codes; a traceback only with ``--debug``."""

import contextlib
import os
import sys
import traceback
from typing import Any

from dap3d_core.cli.console.console import json_value, print_json, stderr
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.memory import address_space, is_used_up
from dap3d_core.cli.process.streams import leave_stderr


def report_error(error: BaseException, *, debug: bool, as_json: bool) -> int:
    """Print an error to stderr and, with ``as_json``, as one JSON object to stdout.

    Returns:
        The exit code.
    """
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    code, text = _judge(error)
    mistakes = mistakes_of(error)
    if as_json:
        data: dict[str, Any] = {"error": text, "exit_code": code}
        with contextlib.suppress(OSError):
            print_json({"mistakes": mistakes, **data} if mistakes else data)
    try:
        console = stderr()
        if mistakes:
            if len(mistakes) > 1:
                console.say(f"{len(mistakes)} mistakes:", "bold red")
            for line in str(error).split("\n"):
                indented = line.startswith("    ")
                console.say(line.strip(), "" if indented else "red", indent=4 if indented else 0)
        else:
            console.say(text, "bold red")
        if code == exit_codes.FAILED and not debug and _is_unexpected(error):
            console.say("run the command again with --debug to see where it happened")
    except OSError:  # stderr is closed or full: the exit code remains
        leave_stderr()
    return code


def mistakes_of(error: BaseException) -> list[dict[str, Any]]:
    """The mistakes of a scene as JSON data; empty for other errors."""
    from dap3d_core.scene import MISSING, SceneError

    if not isinstance(error, SceneError):
        return []
    names = ("file", "line", "key", "value", "what", "nearest", "remedy")
    return [
        {name: getattr(m, name) for name in names}
        | {"value": None if m.value is MISSING else json_value(m.value)}
        for m in error.mistakes
    ]


def _judge(error: BaseException) -> tuple[int, str]:
    """Exit code and text of an error."""
    from dap3d_core.interface.errors import PluginError, is_out_of_memory

    limit = address_space()
    words = "" if limit is None else f"; it may take {limit // 1024:,} kB (ulimit -v)"
    lack = exit_codes.FAILED, f"there is not enough memory for this{words}"
    is_lack = is_out_of_memory(error) or (isinstance(error, Exception) and is_used_up())
    if is_lack and (isinstance(error, MemoryError) or limit is not None):
        return lack
    from dap3d_core.scene import SceneError

    if isinstance(error, KeyboardInterrupt):
        work = f" {error}" if str(error) else ""
        return exit_codes.INTERRUPTED, f"interrupted{work}; nothing was written"
    if isinstance(error, exit_codes.Terminated):
        return exit_codes.FAILED, f"{error}; nothing was written"
    if isinstance(error, (SceneError, PluginError, exit_codes.Refused)):
        return exit_codes.REFUSED, str(error)
    if is_lack:
        return lack
    if _is_unexpected(error):
        text = " ".join(str(error).split())
        return exit_codes.FAILED, f"unexpected {type(error).__name__}{text and f': {text}'}"
    if isinstance(error, FileNotFoundError) and _folder_is_gone():
        text = "the current folder no longer exists; change to another one (cd)"
        return exit_codes.REFUSED, text
    from dap3d_core.result import Computed

    computed = Computed.of(error)
    if computed.part:  # a disk that filled up during a run
        text = f"{error}; what was computed until then is in {computed.part}"
        if computed.checkpoint:
            text += f"; once there is room, dap3d resume {computed.checkpoint} continues the run"
        return exit_codes.PARTIAL, text
    if isinstance(error, OSError) and error.strerror:
        file = f"{error.filename}: " if error.filename else ""
        return exit_codes.FAILED, f"cannot read or write: {file}{error.strerror}"
    return exit_codes.FAILED, str(error)


def _folder_is_gone() -> bool:
    """True if the working folder was removed; its entry "." exists all the same."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _is_unexpected(error: BaseException) -> bool:
    """True if the library does not raise such an error on purpose."""
    from dap3d_core.interface.errors import is_out_of_memory

    is_lack = is_out_of_memory(error) or is_used_up()
    if is_lack or isinstance(error, (OSError, exit_codes.Terminated)):
        return False
    # Looked up, not imported: the broken module may be of the library itself.
    module = sys.modules.get("dap3d_core.simulation.errors")
    return module is None or not isinstance(error, module.SimulationError)


def type_hint(name: str, names: list[str]) -> str:
    """The end of a message about an unknown type: how to install it, or the nearest name."""
    from dap3d_core.registry.discovery import not_yet_installed
    from dap3d_core.registry.suggestions import did_you_mean

    hint = not_yet_installed(name) or did_you_mean(name, names)
    return f"; {hint}" if hint else ""
