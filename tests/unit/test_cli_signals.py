"""Signals while a command works: none is lost, and none is told of by a traceback."""

import ctypes
import os
import signal
import sys
import time

import pytest

from dap3d_core.cli.process.exit_codes import Terminated
from dap3d_core.cli.process.signals import SignalHandler

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


@pytest.mark.parametrize(
    ("number", "expected"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)]
)
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
