"""A time limit for what a plugin does while it is loaded."""

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType

#: Seconds after which what catches everything is interrupted again.
AGAIN = 1.0


class OverdueError(BaseException):
    """What was to end within a time did not; no ``except Exception`` of a plugin catches it."""


@contextlib.contextmanager
def within(limit_s: float | None) -> Iterator[None]:
    """Raise OverdueError in what takes longer; says for how long it was let.

    Only where a system has alarms and in its main thread, which alone gets them; elsewhere there is
    no limit. An alarm that was set before goes on.
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
