"""Runs the points of a study in threads on the cores of this machine."""

import os
import threading
import time
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import SimulationError
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.study import Batch

#: Indices of points, and their outputs.
RunPoints = tuple[Integers, Batch]

#: Seconds that a chunk of points takes in a thread: how often there is progress.
CHUNK_SECONDS = 0.2
#: Seconds for which an early end waits for threads in the middle of a point.
PATIENCE = 1.0


def run_here(
    ensemble: Ensemble, points: Floats, index: Integers, threads: int | None = None
) -> Iterator[RunPoints]:
    """Run points and yield their outputs as they are computed.

    Values depend neither on the number of threads, nor on which points run together. Closing or
    interrupting the iterator stops the threads: none begins other points.

    Args:
        ensemble: runs the points.
        points: (N, parameters) values of the parameters at all points.
        index: (k,) of the points to run.
        threads: number at once; by default one for each core. ``DAP3D_THREADS`` limits it.

    Raises:
        SceneError: ``threads`` is no number of threads.
        SimulationError: ``DAP3D_THREADS`` is none.
    """
    index = np.asarray(index, dtype=np.int64)
    count = min(threads_for(threads), len(index))
    if count > 1:
        return _run_threads(ensemble, points, index, count)
    return _run_serially(ensemble, points, index)


def threads_for(requested: int | None) -> int:
    """Number of threads of a study; arguments and errors as of ``run_here``."""
    text = os.environ.get("DAP3D_THREADS", "").strip()
    if text and not (text.isascii() and text.isdigit() and int(text) > 0):
        raise SimulationError(
            f"the environment variable DAP3D_THREADS is {text!r}; it must be a whole number from "
            "1: studies use at most so many threads; unset, they may use all cores"
        )
    has_affinity = hasattr(os, "sched_getaffinity")
    wanted = len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1
    if requested is not None:
        if isinstance(requested, bool) or not isinstance(requested, int) or requested < 1:
            what = "a whole number from 1, or None for one thread on each core"
            raise SceneError([Mistake("threads", requested, what)])
        wanted = requested
    return min(wanted, int(text)) if text else wanted


@attrs.define
class ChunkSize:
    """Number of points of the next chunk, by the time that earlier ones have taken.

    Attributes:
        seconds: that a chunk should take.
        workers: number of them; the last chunks are smaller, so that all workers end together.
    """

    seconds: float
    workers: int
    _count: float = 0.0
    _time: float = 0.0
    _most: int = 1

    def update(self, count: int, seconds: float) -> None:
        """Take the time of a chunk into account; earlier ones count less."""
        self._count = 0.5 * self._count + count
        self._time = 0.5 * self._time + seconds
        self._most = max(self._most, 16 * count)  # a single point says little

    def next(self, left: int) -> int:
        """The size of the next chunk of the points that are left, from 1."""
        wanted = self.seconds * self._count / max(self._time, 1e-9)
        if self.workers > 1:
            wanted = min(wanted, max(left / (2 * self.workers), 0.05 * wanted))
        return max(1, min(int(wanted), self._most, left))


def timed_run(ensemble: Ensemble, points: Floats) -> tuple[Batch, float]:
    """Outputs of points, and the seconds that they took."""
    begun = time.perf_counter()
    return ensemble.run(points), time.perf_counter() - begun


def _run_serially(ensemble: Ensemble, points: Floats, index: Integers) -> Iterator[RunPoints]:
    chunks = ChunkSize(CHUNK_SECONDS, 1)
    while len(index):
        size = chunks.next(len(index))
        chunk, index = index[:size], index[size:]
        batch, seconds = timed_run(ensemble, points[chunk])
        chunks.update(size, seconds)
        yield chunk, batch


def _run_threads(
    ensemble: Ensemble, points: Floats, index: Integers, count: int
) -> Iterator[RunPoints]:
    """Run points in threads, with two chunks for each: one in work, one in the queue."""
    tasks: SimpleQueue[Integers | None] = SimpleQueue()
    done: SimpleQueue[tuple[Integers, Any, float]] = SimpleQueue()
    threads: list[threading.Thread] = []
    try:
        _start(count, threads, (ensemble, points, tasks, done))
        if not threads:
            yield from _run_serially(ensemble, points, index)
            return
        chunks, waiting = ChunkSize(CHUNK_SECONDS, len(threads)), 0
        while waiting or len(index):
            while len(index) and waiting < 2 * len(threads):
                size = chunks.next(len(index))
                tasks.put(index[:size])
                index = index[size:]
                waiting += 1
            chunk, batch, seconds = done.get()
            waiting -= 1
            if isinstance(batch, BaseException):
                raise batch
            chunks.update(len(chunk), seconds)
            yield chunk, batch
    finally:
        _stop(threads, tasks)


def _start(count: int, threads: list[threading.Thread], arguments: tuple[Any, ...]) -> None:
    """Start as many threads as the system allows.

    They are daemons: compiled code cannot be interrupted, and a thread in the middle of a long
    point must not keep the process alive.
    """
    for _ in range(count):
        thread = threading.Thread(target=_work, args=arguments, name="dap3d-study", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # no more threads
            return
        threads.append(thread)


def _work(ensemble: Ensemble, points: Floats, tasks: Any, done: Any) -> None:
    """Run chunks until there is none."""
    while (chunk := tasks.get()) is not None:
        try:
            found: tuple[Any, float] = timed_run(ensemble, points[chunk])
        except BaseException as error:  # raised again by _run_threads
            found = error, 0.0
        done.put((chunk, *found))


def _stop(threads: list[threading.Thread], tasks: Any) -> None:
    """Empty the queue of tasks and let the threads end."""
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
