"""Signals while a command works: none is lost, and none shows a traceback."""

import contextlib
import ctypes
import os
import signal
import sys
import time

import pytest
from support.internals import Terminated

from dap3d_core.cli.framework.command import SignalHandler

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
each = pytest.mark.parametrize(
    ("number", "expected"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)]
)


@each
def test_a_signal_before_the_run_raises_at_once(number, expected):
    before = signal.getsignal(number)
    with pytest.raises(expected), SignalHandler():
        signal.raise_signal(number)
    assert signal.getsignal(number) == before


def test_during_a_run_it_waits_for_the_end_of_the_chunk_once():
    calls = []
    with SignalHandler() as signals:
        callback = signals.interruptible(calls.append)
        callback(1)
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Terminated, match="SIGTERM"):
            callback(2)
        callback(3)  # raised once
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert calls == [1, 2, 3]


def test_an_interrupt_that_a_package_swallowed_is_not_forgotten():
    def import_half():
        with contextlib.suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        raise AttributeError("half imported")

    with pytest.raises(KeyboardInterrupt), SignalHandler():
        import_half()


@each
def test_a_signal_that_a_callback_swallows_comes_again(capfd, number, expected):
    """An exception cannot leave a callback of a C library: Python prints and forgets it."""

    @ctypes.CFUNCTYPE(None)
    def callback():
        os.kill(os.getpid(), number)
        time.sleep(0.0)  # the handler has run by now

    def work():
        callback()
        while True:  # as a compiler does, until it is ended
            time.sleep(0.01)

    before = sys.unraisablehook
    with pytest.raises(expected), SignalHandler():
        work()
    assert sys.unraisablehook is before
    assert capfd.readouterr().err == ""


def test_other_exceptions_of_callbacks_are_still_printed(capfd, monkeypatch):
    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)

    @ctypes.CFUNCTYPE(None)
    def callback():
        raise ValueError("a fault of the callback")

    with SignalHandler():
        callback()
    assert "a fault of the callback" in capfd.readouterr().err
