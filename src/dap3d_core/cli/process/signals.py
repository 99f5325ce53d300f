"""Ctrl-C and SIGTERM between two chunks of a run, so that what was computed can be saved."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

from dap3d_core.cli.process.exit_codes import Terminated

#: Seconds after which a signal that was swallowed is sent again.
AGAIN = 0.05
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class SignalHandler:
    """Context manager in which signals end a command in an orderly way.

    A signal raises at once: KeyboardInterrupt for Ctrl-C, ``Terminated`` for others. After the
    first ``raise_pending`` it waits for the next one, so that no chunk of a run is lost; a second
    signal does not wait. A signal that is swallowed by a callback of a C library (the compiler's,
    for example) is sent again a moment later.
    """

    def __init__(self) -> None:
        self._pending: int | None = None
        self._waits = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "SignalHandler":
        for name in _NAMES:
            number = getattr(signal, name, None)
            if number is None or signal.getsignal(number) is signal.SIG_IGN:  # as nohup sets it
                continue
            try:
                self._before[number] = signal.signal(number, self._handle)
            except ValueError:  # not the main thread, which alone may handle signals
                break
        self._hook, sys.unraisablehook = sys.unraisablehook, self._resend
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        sys.unraisablehook = self._hook
        for number, before in self._before.items():
            signal.signal(number, before)
        # A package interrupted in its import may catch the interrupt and fail later for another
        # reason.
        if self._pending is not None and not self._waits and isinstance(error, Exception):
            raise _exception(self._pending) from error

    def raise_pending(self) -> None:
        """Raise the exception of a pending signal; later signals wait for this call."""
        self._waits = True
        pending, self._pending = self._pending, None
        if pending is not None:
            raise _exception(pending)

    def interruptible(self, callback: Callable[..., None]) -> Callable[..., None]:
        """A callback of a run that raises pending signals after each call."""

        def call(*arguments: Any) -> None:
            callback(*arguments)
            self.raise_pending()

        return call

    def _resend(self, lost: "sys.UnraisableHookArgs") -> None:
        if isinstance(lost.exc_value, (KeyboardInterrupt, Terminated)):
            number = self._pending or signal.SIGINT
            again = threading.Timer(AGAIN, _thread.interrupt_main, [number])
            again.daemon = True
            again.start()
        else:
            self._hook(lost)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        waits = self._waits and self._pending is None
        self._pending = number
        if not waits:
            raise _exception(number)


def _exception(number: int) -> BaseException:
    if number == signal.SIGINT:
        return KeyboardInterrupt()
    return Terminated(f"ended by {signal.Signals(number).name}")
