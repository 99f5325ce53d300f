"""The points of a study on a cluster, by dask: tasks of some points each."""

import asyncio
import hashlib
import logging
import time
import uuid
from collections import OrderedDict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from threading import Lock
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result import current_versions
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import SimulationError
from dap3d_core.study.study import Batch, Ensemble, Study
from dap3d_core.study.workers.environment import (
    Environment,
    bare_environment,
    differences,
    environment_of,
    other_versions,
    with_whole_path,
)
from dap3d_core.study.workers.threads import Portions

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Found = tuple[Integers, Batch]

#: Seconds that a task is to take: its transport, some milliseconds, is then no matter.
SECONDS = 1.0
#: Seconds to wait for a scheduler that does not answer, for a first worker, and for another one
#: where all are gone.
ANSWER, ARRIVAL, ABSENCE = 10.0, 10.0, 60.0
#: Seconds from one look at the cluster to the next.
LOOK = 2.0
#: Studies whose compiled models a worker keeps.
KEPT = 4
#: Workers that a message names.
NAMED = 10


class ClusterError(SimulationError):
    """A study cannot be run on a cluster; says what to do."""


def connect(address: str, timeout: float = ANSWER) -> Any:
    """A client of the scheduler at an address, such as ``tcp://node7:8786``.

    Raises:
        ClusterError: dask is not installed, or nobody answers within ``timeout`` s.
    """
    distributed = _distributed()
    # A scheduler that goes away is told by an error, not by a traceback in a log as well.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL + 1)
    try:
        with ThreadPoolExecutor(1) as beside:  # this thread may have an event loop of its own
            beside.submit(asyncio.run, _greet(address, timeout)).result()
        return distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError, RuntimeError) as error:
        reason = str(error) or f"nothing was said within {timeout:g} s"
        raise ClusterError(
            f"no dask scheduler answers at {address} ({reason.splitlines()[0]}); start one with "
            "`dask scheduler`, which prints its address, such as tcp://node7:8786"
        ) from error


async def _greet(address: str, timeout: float) -> None:
    """Exchange greetings with a scheduler; a client would wait for ever for one that is silent.

    A client that could not be made also leaves a traceback when it is collected.
    """
    distributed = _distributed()
    options = distributed.Security().get_connection_args("client")
    comm = distributed.core.connect(address, timeout=timeout, **options)
    await (await asyncio.wait_for(comm, timeout)).close()


def run_on(
    client: Any,
    study: Study,
    points: Floats,
    places: Integers,
    chunk: int | None = None,
    retries: int = 2,
) -> Iterator[Found]:
    """Run points on the workers of a cluster and give what came of them as it comes.

    Numbers are those of ``run_here`` where versions are the same. What a worker had that was lost
    is run again by another one; no point is given twice. Whoever stops asking, or is interrupted,
    cancels the tasks: none begins, those that run end by themselves.

    Args:
        client: a ``distributed.Client``.
        study: what is done at each point.
        points: (N, numbers) the values of the numbers at all points.
        places: which of them to run.
        chunk: points of a task; by default as many as take about a second.
        retries: how often a task that raised an exception is tried again.

    Raises:
        SceneError: ``client`` is no client, ``chunk`` no number of points.
        ClusterError: the cluster has no workers, or some of them lack what the study needs or have
            other versions: each is named with the remedy, and no point is run.
    """
    _refuse(client, chunk)
    study, places = with_whole_path(study), np.asarray(places, dtype=np.int64)
    here = environment_of(study)
    if here["fault"]:
        raise ClusterError(here["fault"])
    payload = _pickled(study, here)
    check_workers(client, here, payload)
    return _run(client, payload, np.asarray(points, dtype=float), places, chunk, retries)


def check_workers(client: Any, here: Environment, payload: bytes) -> None:
    """Ask all workers, before any point is run, whether they have what the study needs.

    Args:
        client: of their scheduler.
        here: what this process has.
        payload: pickled: the study, ``here``.

    Raises:
        ClusterError: there are no workers, or some cannot run the study; names them.
    """
    with _asking(client):
        try:
            client.wait_for_workers(1, timeout=ARRIVAL)
        except TimeoutError as error:
            address = _address(client)
            raise ClusterError(
                f"the scheduler at {address} has no workers; start some with "
                f"`dask worker {address}`"
            ) from error
        answers = client.run(environment_there, current_versions(), payload, on_error="return")
    faults = {worker: _faults(here, answer) for worker, answer in sorted(answers.items())}
    unfit = [f"{worker}: {'; '.join(found)}" for worker, found in faults.items() if found]
    if unfit:
        more = [f"... and {len(unfit) - NAMED} more"] if len(unfit) > NAMED else []
        title = f"{len(unfit)} of {len(answers)} workers cannot run this study:"
        raise ClusterError("\n".join([title, *unfit[:NAMED], *more]))


def environment_there(versions: dict[str, str], payload: bytes) -> Environment:
    """What this process, a worker, has of what a study needs.

    Args:
        versions: of who asks; where Python or dap3d differ, nothing is unpickled.
        payload: pickled: the study, what is there where it comes from.
    """
    found = bare_environment()
    if not other_versions(versions, found["versions"]):
        import cloudpickle

        try:
            return environment_of(cloudpickle.loads(payload)[0])
        except Exception as error:  # of a module that is not there: whatever it raises
            found["fault"] = (
                f"it cannot load the study ({type(error).__name__}: {error}); functions among the "
                "outputs must stand in the script, or in a module that can be imported there"
            )
    return found


def _faults(here: Environment, answer: Any) -> list[str]:
    """What keeps a worker from running the study, by its answer."""
    if isinstance(answer, BaseException):
        version = here["versions"]["dap3d"]
        return [
            f'dap3d {version} cannot be used there ({answer}); pip install "dap3d[cluster]'
            f'=={version}" in its environment'
        ]
    return differences(here, answer)


def _run(
    client: Any,
    payload: bytes,
    points: Floats,
    places: Integers,
    chunk: int | None,
    retries: int,
) -> Iterator[Found]:
    name = f"dap3d-{uuid.uuid4().hex[:12]}"
    digest = hashlib.sha256(payload).hexdigest()
    # A task whose result is the study, and not data that is scattered: dask makes it again where
    # the worker that had it is lost. Each worker gets it once.
    with _asking(client):
        study = client.submit(_as_it_is, payload, key=f"{name}-study", pure=False)
    done = _distributed().as_completed(loop=client.loop, with_results=True, raise_errors=False)
    portions, watch = Portions(SECONDS, 1), _Watch(client)
    waiting: dict[Any, Integers] = {}
    try:
        while waiting or len(places):
            portions.workers = watch.cores
            while len(places) and len(waiting) < 2 * portions.workers:
                size = chunk or portions.next(len(places))
                part, places = places[:size], places[size:]
                with _asking(client):
                    future = client.submit(
                        run_points,
                        study,
                        digest,
                        points[part],
                        key=f"{name}-{part[0]}",
                        retries=retries,
                        pure=False,
                    )
                waiting[future] = part
                done.add(future)
            watch.wait(done)
            future, found = next(done)
            part = waiting.pop(future)
            # Not by the state of the future: a worker may be lost after its result was fetched.
            if not (isinstance(found, tuple) and isinstance(found[0], Batch)):
                _raise(client, found, part)
            batch, seconds = found
            portions.note(len(part), seconds)
            del future, found  # or the cluster would keep it
            yield part, batch
    finally:
        if client.status == "running":
            with suppress(ClusterError), _asking(client):
                client.cancel([*waiting, study])


class _Watch:
    """Looks at a cluster from time to time.

    Attributes:
        cores: threads of all workers, from 1.
    """

    def __init__(self, client: Any) -> None:
        self.client, self.cores = client, 1
        self._seen = self._next = time.monotonic()
        self._look()

    def wait(self, done: Any) -> None:
        """Wait until a task has ended.

        Raises:
            ClusterError: there have been no workers for some time, or the scheduler is gone.
        """
        while not done.has_ready():
            if self.client.status != "running":  # then dask may never speak of a task again
                raise _gone(self.client)
            self._look()
            time.sleep(0.01)
        self._look()

    def _look(self) -> None:
        now = time.monotonic()
        if now < self._next or self.client.status != "running":
            return
        self._next = now + LOOK
        try:
            cores = sum(self.client.nthreads().values())
        except OSError as error:  # most likely the client sees soon that nobody is there
            if now - self._seen > ABSENCE:
                raise _gone(self.client) from error
            return
        if cores:
            self._seen, self.cores = now, cores
        elif now - self._seen > ABSENCE:
            address = _address(self.client)
            raise ClusterError(
                f"the scheduler at {address} has lost all its workers; start others with "
                f"`dask worker {address}`, and look into the logs of those"
            )


def run_points(payload: bytes, digest: str, points: Floats) -> tuple[Batch, float]:
    """What a task is: run points, on a worker.

    Returns:
        What came of them, and how many seconds they took.
    """
    ensemble = _ensemble(payload, digest)
    begun = time.perf_counter()
    batch = ensemble.run(points)
    return batch, time.perf_counter() - begun


#: Of a worker's process: the compiled studies by their digest, the last one used at the end.
_ensembles: OrderedDict[str, Ensemble] = OrderedDict()
_one_at_a_time = Lock()


def _ensemble(payload: bytes, digest: str) -> Ensemble:
    """The compiled study, compiled once in a process."""
    with _one_at_a_time:
        if digest not in _ensembles:
            import cloudpickle

            study, elsewhere = cloudpickle.loads(payload)
            # a worker that came after all had been asked
            if faults := differences(elsewhere, environment_of(study)):
                address = _distributed().get_worker().address
                raise ClusterError(f"{address} cannot run this study: {'; '.join(faults)}")
            _ensembles[digest] = Ensemble(study)
            while len(_ensembles) > KEPT:
                _ensembles.popitem(last=False)
        _ensembles.move_to_end(digest)
        return _ensembles[digest]


def _as_it_is(payload: bytes) -> bytes:
    return payload


def _raise(client: Any, found: Any, part: Integers) -> NoReturn:
    """Say why a task has no result."""
    error = found[1] if isinstance(found, tuple) else found
    if isinstance(error, _distributed().KilledWorker):
        raise ClusterError(
            f"a task of {len(part)} points, from place {part[0]} on, has ended each worker that "
            f"ran it, the last one {error.last_worker.address}: its log says why (often there was "
            "not enough memory)"
        ) from error
    if not isinstance(found, tuple):  # cancelled
        if client.status != "running":
            raise _gone(client) from error
        raise ClusterError(
            f"the scheduler at {_address(client)} has dropped the tasks: somebody has cancelled "
            "them"
        ) from error
    raise error.with_traceback(found[2])


@contextmanager
def _asking(client: Any) -> Iterator[None]:
    """Something asked of the scheduler, or told to it.

    Raises:
        ClusterError: it is not there any more.
    """
    try:
        yield
    except Exception as error:  # of a client that has closed meanwhile: a kind of its own
        if isinstance(error, OSError) or client.status != "running":
            raise _gone(client) from error
        raise


def _gone(client: Any) -> ClusterError:
    return ClusterError(f"the scheduler at {_address(client)} is gone")


def _refuse(client: Any, chunk: Any) -> None:
    mistakes = []
    distributed = _distributed()
    if not isinstance(client, distributed.Client) or client.asynchronous:
        what = "a distributed.Client that is not asynchronous"
        mistakes.append(Mistake("client", client, what, remedy='Client("tcp://node7:8786")'))
    if chunk is not None and (type(chunk) is not int or chunk < 1):
        what = "a whole number of points from 1, or None for about a second a task"
        mistakes.append(Mistake("chunk", chunk, what))
    if mistakes:
        raise SceneError(mistakes)


def _pickled(study: Study, here: Environment) -> bytes:
    """The study and what it needs; functions of the script by value."""
    import cloudpickle

    try:
        payload: bytes = cloudpickle.dumps((study, here))
    except Exception as error:  # of a function that holds a lock, a file, ...
        raise ClusterError(
            f"the study cannot be sent to other processes ({type(error).__name__}: {error}); "
            "functions among its outputs must hold plain data alone"
        ) from error
    return payload


def _address(client: Any) -> str:
    scheduler = client.scheduler
    return str(scheduler.address) if scheduler is not None else "an unknown address"


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise ClusterError(
            f"a cluster needs dask, which is not installed here ({error}); "
            'pip install "dap3d[cluster]"'
        ) from error
    return distributed
