"""Ctrl-C and SIGTERM between two chunks of a run, so that what was computed can be kept."""

import _thread
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Any

from dap3d_core.cli.process.exit_codes import Terminated

#: Seconds after which a signal that was swallowed comes again.
AGAIN = 0.05
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Stopping:
    """While it lasts, signals end a command in an orderly way.

    A signal raises at once: KeyboardInterrupt for Ctrl-C, ``Terminated`` for others. From the first
    ``between_chunks`` on it waits for the next one, so that no chunk of a run is lost; a second
    signal no longer waits. One that a callback of a C library swallows, as of the compiler, comes
    again a moment later.
    """

    def __init__(self) -> None:
        self._asked: int | None = None
        self._patient = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "Stopping":
        for name in _NAMES:
            number = getattr(signal, name, None)
            if number is None or signal.getsignal(number) is signal.SIG_IGN:  # nohup asked for it
                continue
            try:
                self._before[number] = signal.signal(number, self._handle)
            except ValueError:  # not the main thread: signals are someone else's affair
                break
        self._hook, sys.unraisablehook = sys.unraisablehook, self._swallowed
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        sys.unraisablehook = self._hook
        for number, before in self._before.items():
            signal.signal(number, before)
        # Packages that are imported catch everything, and stumble later over what is missing.
        if self._asked is not None and not self._patient and isinstance(error, Exception):
            raise _exception(self._asked) from error

    def between_chunks(self) -> None:
        """Raise what a signal asked for meanwhile; from now on signals wait for this call."""
        self._patient = True
        asked, self._asked = self._asked, None
        if asked is not None:
            raise _exception(asked)

    def _swallowed(self, lost: "sys.UnraisableHookArgs") -> None:
        if isinstance(lost.exc_value, (KeyboardInterrupt, Terminated)):
            again = threading.Timer(AGAIN, _thread.interrupt_main, [self._asked or signal.SIGINT])
            again.daemon = True
            again.start()
        else:
            self._hook(lost)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        waits = self._patient and self._asked is None
        self._asked = number
        if not waits:
            raise _exception(number)


def _exception(number: int) -> BaseException:
    if number == signal.SIGINT:
        return KeyboardInterrupt()
    return Terminated(f"ended by {signal.Signals(number).name}")
