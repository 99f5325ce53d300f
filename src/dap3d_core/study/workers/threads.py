"""The points of a study on the cores of this machine."""

import os
import threading
import time
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import SimulationError
from dap3d_core.study.study import Batch, Ensemble

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Found = tuple[Integers, Batch]

#: Seconds that the points take which a thread is given at once: how often there is news.
SECONDS = 0.2
#: Seconds that who ends early waits for threads in the middle of a point.
PATIENCE = 1.0


def run_here(
    ensemble: Ensemble, points: Floats, places: Integers, threads: int | None = None
) -> Iterator[Found]:
    """Run points and give what came of them as it comes.

    Numbers do not depend on how many threads there are, nor on which points come together.
    Whoever stops asking, or is interrupted, stops the threads: none begins other points.

    Args:
        ensemble: what runs them.
        points: (N, numbers) the values of the numbers at all points.
        places: which of them to run.
        threads: how many at once; by default one for each core. ``DAP3D_THREADS`` limits it.

    Raises:
        SceneError: ``threads`` is no number of threads.
        SimulationError: ``DAP3D_THREADS`` is none.
    """
    places = np.asarray(places, dtype=np.int64)
    count = min(threads_for(threads), len(places))
    if count > 1:
        return _by_many(ensemble, points, places, count)
    return _by_one(ensemble, points, places)


def cores_allowed() -> int:
    """Number of cores that the process may use: its own ones, or ``DAP3D_THREADS`` if less.

    Raises:
        ValueError: ``DAP3D_THREADS`` is no number of threads.
    """
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    return min(cores, threads_limit() or cores)


def threads_limit() -> int | None:
    """The number of threads that ``DAP3D_THREADS`` allows; None where it is not set.

    Raises:
        ValueError: it is no number of threads.
    """
    text = os.environ.get("DAP3D_THREADS", "").strip()
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise ValueError(
            f"the environment variable DAP3D_THREADS is {text!r}; it must be a whole number from "
            "1: studies use at most so many threads; unset, they may use all cores"
        )
    return int(text)


def threads_for(asked: int | None) -> int:
    """How many threads a study takes when ``asked`` for some; errors as of ``run_here``."""
    try:
        limit, cores = threads_limit(), cores_allowed()
    except ValueError as error:
        raise SimulationError(str(error)) from error
    if asked is None:
        return cores
    if isinstance(asked, bool) or not isinstance(asked, int) or asked < 1:
        what = "a whole number from 1, or None for one thread on each core"
        raise SceneError([Mistake("threads", asked, what)])
    return min(asked, limit or asked)


@attrs.define
class Portions:
    """How many points to hand out at once, by the time that those before have taken.

    Attributes:
        seconds: that a portion is to take.
        workers: who take portions; towards the end these are smaller, so that all end together.
    """

    seconds: float
    workers: int
    _count: float = 0.0
    _time: float = 0.0
    _most: int = 1

    def note(self, count: int, seconds: float) -> None:
        """Learn how long a portion has taken; what was long ago counts less."""
        self._count = 0.5 * self._count + count
        self._time = 0.5 * self._time + seconds
        self._most = max(self._most, 16 * count)  # a single point says little

    def next(self, left: int) -> int:
        """The size of the next portion where so many points are left, from 1."""
        pace = self._count / max(self._time, 1e-9)
        wanted = self.seconds * pace
        if self.workers > 1:
            wanted = min(wanted, max(left / (2 * self.workers), 0.05 * wanted))
        return max(1, min(int(wanted), self._most, left))


def _by_one(ensemble: Ensemble, points: Floats, places: Integers) -> Iterator[Found]:
    """Run points in this thread."""
    portions = Portions(SECONDS, 1)
    while len(places):
        size = portions.next(len(places))
        chunk, places = places[:size], places[size:]
        begun = time.perf_counter()
        batch = ensemble.run(points[chunk])
        portions.note(size, time.perf_counter() - begun)
        yield chunk, batch


def _by_many(ensemble: Ensemble, points: Floats, places: Integers, count: int) -> Iterator[Found]:
    """Run points in threads; each has a portion that it works on and one that waits for it."""
    tasks: SimpleQueue[Integers | None] = SimpleQueue()
    done: SimpleQueue[tuple[Integers, Any, float]] = SimpleQueue()
    threads: list[threading.Thread] = []
    try:
        _start(count, threads, (ensemble, points, tasks, done))
        if not threads:
            yield from _by_one(ensemble, points, places)
            return
        portions, waiting = Portions(SECONDS, len(threads)), 0
        while waiting or len(places):
            while len(places) and waiting < 2 * len(threads):
                size = portions.next(len(places))
                tasks.put(places[:size])
                places = places[size:]
                waiting += 1
            chunk, batch, seconds = done.get()
            waiting -= 1
            if isinstance(batch, BaseException):
                raise batch
            portions.note(len(chunk), seconds)
            yield chunk, batch
    finally:
        _end(threads, tasks)


def _start(count: int, threads: list[threading.Thread], arguments: tuple[Any, ...]) -> None:
    """Start threads, as many as can be had.

    Compiled code cannot be ended from outside: a thread in the middle of a long point may be left
    to itself, and so ends with the process.
    """
    for _ in range(count):
        thread = threading.Thread(target=_work, args=arguments, name="dap3d-study", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # no other thread to be had
            return
        threads.append(thread)


def _work(ensemble: Ensemble, points: Floats, tasks: Any, done: Any) -> None:
    """Run portions until there is none: what a thread does."""
    while (chunk := tasks.get()) is not None:
        begun = time.perf_counter()
        try:
            found: Any = ensemble.run(points[chunk])
        except BaseException as error:  # whatever it is: it belongs to who asked
            found = error
        done.put((chunk, found, time.perf_counter() - begun))


def _end(threads: list[threading.Thread], tasks: Any) -> None:
    """Take back what no thread has begun, and let the threads go."""
    try:
        while True:
            tasks.get_nowait()
    except Empty:
        pass
    for _ in threads:
        tasks.put(None)
    end = time.monotonic() + PATIENCE
    for thread in threads:
        thread.join(max(0.0, end - time.monotonic()))
