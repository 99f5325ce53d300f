"""The second thread of a large scene: it lives as long as one call of compiled code.

A plain thread of Python that runs compiled code without the lock of the interpreter. So there is no
layer of threads that a process would keep, or that a forked child would miss.
"""

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.formulations.two_threads.rhs_halves import DONE, GONE, STOP, work_beside
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.kernels.runtime.function_lists import LOOP_LIST

#: After so many calls the slower way, with or without the second thread, is tried again.
TRIAL = 20


class _Share(threading.local):
    """Of each thread: whether others work beside it on runs of their own."""

    is_one_of_many = False


_share = _Share()


@contextmanager
def one_of_many() -> Iterator[None]:
    """Runs of this thread get no second one meanwhile: all cores have runs of their own."""
    before, _share.is_one_of_many = _share.is_one_of_many, True
    try:
        yield
    finally:
        _share.is_one_of_many = before


def cores_allowed() -> int:
    """How many cores the process may use: those of the machine that are its, or DAP3D_THREADS.

    Raises:
        ValueError: ``DAP3D_THREADS`` is no number of threads.
    """
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    return min(cores, threads_limit() or cores)


def threads_limit() -> int | None:
    """What ``DAP3D_THREADS`` says: at most so many threads; None where it says nothing.

    Raises:
        ValueError: it is no number of threads.
    """
    asked = os.environ.get("DAP3D_THREADS", "").strip()
    if not asked:
        return None
    if not (asked.isascii() and asked.isdigit() and int(asked) > 0):
        raise ValueError(
            f"the environment variable DAP3D_THREADS is {asked!r}; it must be a whole number from "
            "1: at most so many threads are used, and 1 keeps a large scene on one core; unset, "
            "all cores are allowed"
        )
    return int(asked)


def threads_allowed() -> int:
    """How many threads a run may use: 2 where there is a second core and nobody forbids it.

    ``DAP3D_THREADS=1`` forbids it, and so does ``one_of_many``.

    Raises:
        ValueError: ``DAP3D_THREADS`` is no number of threads.
    """
    cores = cores_allowed()
    if _share.is_one_of_many or not jit_is_on() or not hasattr(os, "sched_yield"):
        return 1
    return min(2, cores)


class SecondThread:
    """Works beside the thread that enters it, until that leaves; used again for each call.

    On a machine whose cores are in use two threads wait for each other and may be slower than one:
    ``call`` measures both ways and takes the faster one. Numbers do not depend on it.

    Raises (on leaving) what the second thread has raised, if nothing else is being raised.
    """

    def __init__(self, system: Any, loops: Any) -> None:
        """system: with ``halves``; loops: its group loops."""
        self._arguments = (system, loops)
        self._mail = system.halves.mail
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None
        #: Seconds a right-hand side, by whether a second thread helped; 0: not known yet.
        self._pace = {True: 0.0, False: 0.0}
        self._calls = 0
        if jit_is_on():
            work_beside.compile((System.type_of(), LOOP_LIST))

    def call(self, advance: Callable[[], None], count: Callable[[], int]) -> None:
        """Call ``advance``, with the second thread if that has been faster.

        Args:
            advance: compiled code that evaluates right-hand sides.
            count: how many there were so far.
        """
        helped = self._faster()
        before, clock = count(), time.perf_counter()
        if helped:
            with self:
                advance()
        else:
            advance()
        if done := count() - before:
            self._pace[helped] = (time.perf_counter() - clock) / done

    def _faster(self) -> bool:
        """Whether the next call is to be helped: the faster way, at times the other one."""
        self._calls += 1
        faster = self._pace[True] <= self._pace[False]
        return faster != (self._calls % TRIAL == 0)

    @property
    def tickets(self) -> int:
        """The last ticket that the second thread has done since it was started; 0: none."""
        return int(self._mail[DONE])

    def __enter__(self) -> None:
        self._mail[:] = 0
        self._error = None
        thread = threading.Thread(target=self._work, name="dap3d", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # no thread to be had: the first one does all
            return
        self._thread = thread

    def __exit__(self, kind: Any, *_: Any) -> None:
        self._mail[STOP] = 1
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._error is not None and kind is None:
            raise self._error

    def _work(self) -> None:
        try:
            work_beside(*self._arguments)
        except BaseException as error:  # whatever it is: it belongs to who waits for this thread
            self._error = error
        finally:
            self._mail[GONE] = 1
