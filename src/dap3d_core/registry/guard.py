"""Guards the loading of a plugin: its failures are ``PluginError``, its side effects undone."""

import contextlib
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from dap3d_core.interface.errors import PluginError, is_out_of_memory
from dap3d_core.interface.hooks import EXTENSIONS
from dap3d_core.registry.discovery import BLOCK_VARIABLE, Source

#: Plugins are loaded one at a time: the guard changes state of the whole process.
_one_at_a_time = threading.RLock()
#: Interval of the alarm, s: a plugin that catches everything is interrupted again.
AGAIN = 1.0


class OverdueError(BaseException):
    """The time limit has passed; no ``except Exception`` of a plugin catches it."""


@contextlib.contextmanager
def within(limit_s: float | None) -> Iterator[None]:
    """Raise OverdueError, with the limit, in code that takes longer.

    Only where the system has alarms and in the main thread, which alone receives them; otherwise
    there is no limit. An alarm set before stays set.
    """
    can = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
    if limit_s is None or not can:
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise OverdueError(f"{limit_s:g} s")

    began, handler = time.monotonic(), signal.signal(signal.SIGALRM, ring)
    left, interval = signal.setitimer(signal.ITIMER_REAL, limit_s, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        if left:
            remaining = max(left - (time.monotonic() - began), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, remaining, interval)


@contextlib.contextmanager
def guard(source: Source, notes: list[str]) -> Iterator[None]:
    """Turn every failure of a plugin into a PluginError that names it, with a remedy.

    Ctrl-C remains a KeyboardInterrupt, with the name of the plugin.
    """
    folder = os.getcwd()  # a deleted folder is no failure of the plugin
    try:
        with _one_at_a_time, _restored(source, folder, notes):
            yield
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(f"while {_title(source)} was loaded") from error
    except OverdueError as error:
        reason = f"it is not loaded after {error}{_line_of(error)}"
        raise PluginError(f"{_title(source)}: {reason}{_remedy(source)}") from error
    except PluginError as error:
        reason = str(error).removeprefix(f"{Path(source.module).absolute()}: ")
        raise PluginError(f"{_title(source)}: {reason}{_remedy(source)}") from error
    except BaseException as error:  # SystemExit too: a plugin does not end the program
        if is_out_of_memory(error) and not isinstance(error, MemoryError):  # of a library's file
            raise MemoryError from error
        raise PluginError(f"{_title(source)}: {_reason(error)}{_remedy(source)}") from error


@contextlib.contextmanager
def _restored(source: Source, folder: str, notes: list[str]) -> Iterator[None]:
    """Restore stdout, the working folder, the handler of Ctrl-C and numpy's error state.

    A changed sys.path is left changed, and noted. A forked copy of the process ends here: both
    would continue the command.
    """
    process, path = os.getpid(), list(sys.path)
    interrupt = signal.getsignal(signal.SIGINT)
    numpy: Any = sys.modules.get("numpy")
    state: dict[str, Any] = numpy.geterr() if numpy else {}
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        if os.getpid() != process:
            print(
                f"{source}: forked while it was loaded; the copy ends", file=sys.stderr, flush=True
            )
            os._exit(1)
        is_main = threading.current_thread() is threading.main_thread()  # the others may not
        if is_main and interrupt and signal.getsignal(signal.SIGINT) is not interrupt:
            signal.signal(signal.SIGINT, interrupt)
            notes.append(f"{source}: changed what Ctrl-C does while it was loaded; put back")
        if sys.path != path:
            notes.append(f"{source}: changed sys.path while it was loaded; it was left so")
        if os.getcwd() != folder:
            os.chdir(folder)
            notes.append(f"{source}: changed the working folder while it was loaded; put back")
        if numpy and numpy.geterr() != state:
            numpy.seterr(**state)
            notes.append(f"{source}: changed numpy's error state while it was loaded; put back")


def _title(source: Source) -> str:
    if not source.distribution:
        return source.module
    return f"{noun_of(source.kind)} {source.keyword!r} of {source}"


def noun_of(kind: str) -> str:
    """A kind in messages: a joint type, an integrator."""
    return kind if kind in EXTENSIONS else f"{kind} type"


def _remedy(source: Source) -> str:
    """The sentence on what to do with a package; a file is repaired, which needs no words."""
    if not source.distribution:
        return ""
    name = source.distribution
    leaving = f"{BLOCK_VARIABLE}={name}:{source.keyword}"
    return f"; repair, update or uninstall {name}, or leave it out with {leaving}"


def _reason(error: BaseException) -> str:
    """An exception in one line: type, message, and the line of the plugin where it arose."""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if isinstance(error, SyntaxError):
        return f"{text} [{error.filename}:{error.lineno}]"
    return text + _line_of(error)


def _line_of(error: BaseException) -> str:
    """The line of the plugin where an exception arose, in brackets."""
    here = [Path(__file__).parent, Path(contextlib.__file__).parent]
    frames = traceback.extract_tb(error.__traceback__)
    outside = [f for f in frames if not any(Path(f.filename).is_relative_to(h) for h in here)]
    outside = [f for f in outside if not f.filename.startswith("<frozen")]
    return f" [{outside[-1].filename}:{outside[-1].lineno}]" if outside else ""
