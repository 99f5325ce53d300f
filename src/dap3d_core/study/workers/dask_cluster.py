"""Runs the points of a study on a cluster by dask: tasks of some points each."""

import asyncio
import hashlib
import logging
import os
import time
import uuid
from collections import OrderedDict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from threading import Lock
from typing import Any, NoReturn

import attrs
import numpy as np

from dap3d_core.interface import PluginError
from dap3d_core.interface.hooks import GROUPS
from dap3d_core.kernels.runtime.source_digest import driver_digest
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.registry import Registry, load_registry
from dap3d_core.result import current_versions
from dap3d_core.scene import Mistake, SceneError, check
from dap3d_core.simulation import SimulationError
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.study import Batch, Study
from dap3d_core.study.workers.threads import ChunkSize, RunPoints, timed_run

#: What a process has of what a study needs, as plain data, which any version of dap3d can read:
#: ``versions``; ``sources``, a digest of the core; ``types``, for each "joint rev" of the scene
#: ``package``, ``version``, ``module``, ``digest``, or None where nothing is known of the scene;
#: ``fault``, why it cannot be used.
Environment = dict[str, Any]


#: Seconds that a task should take: much longer than its transport of some milliseconds.
TASK_SECONDS = 1.0
#: Seconds to wait for the answer of a scheduler, for a first worker, and for another one where all
#: are lost.
ANSWER, ARRIVAL, ABSENCE = 10.0, 10.0, 60.0
#: Seconds between requests for the number of workers.
POLL_SECONDS = 2.0
#: Number of studies whose compiled models a worker keeps.
MAX_ENSEMBLES = 4
#: Largest number of workers in a message.
MAX_NAMES = 10


class ClusterError(SimulationError):
    """A study cannot be run on a cluster; the message gives the remedy."""


def connect(address: str, timeout: float = ANSWER) -> Any:
    """A client of the scheduler at an address, such as ``tcp://node7:8786``.

    Raises:
        ClusterError: dask is not installed, or nobody answers within ``timeout`` s.
    """
    distributed = _distributed()
    # A lost scheduler raises an error, and needs no traceback in a log in addition.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL + 1)
    try:
        with ThreadPoolExecutor(1) as thread:  # the current one may have an event loop of its own
            thread.submit(asyncio.run, _greet(address, timeout)).result()
        return distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError, RuntimeError) as error:
        reason = str(error) or f"no answer within {timeout:g} s"
        raise ClusterError(
            f"no dask scheduler answers at {address} ({reason.splitlines()[0]}); start one with "
            "`dask scheduler`, which prints its address, such as tcp://node7:8786"
        ) from error


async def _greet(address: str, timeout: float) -> None:
    """Exchange greetings with a scheduler.

    A client would wait for ever for a silent one, and a client that could not be made leaves a
    traceback when it is collected.
    """
    distributed = _distributed()
    options = distributed.Security().get_connection_args("client")
    comm = distributed.core.connect(address, timeout=timeout, **options)
    await (await asyncio.wait_for(comm, timeout)).close()


def run_on(
    client: Any,
    study: Study,
    points: Floats,
    index: Integers,
    chunk: int | None = None,
    retries: int = 2,
) -> Iterator[RunPoints]:
    """Run points on the workers of a cluster and yield their outputs as they are computed.

    Values are those of ``run_here`` where versions are the same. Tasks of a lost worker are run
    again by another one; no point is yielded twice. Closing or interrupting the iterator cancels
    the tasks: none begins, those that run end.

    Args:
        client: a ``distributed.Client``.
        study: the work at each point.
        points: (N, parameters) values of the parameters at all points.
        index: (k,) of the points to run.
        chunk: points of a task; by default as many as take about a second.
        retries: of a task that raised an exception.

    Raises:
        SceneError: ``client`` is no client.
        ClusterError: the cluster has no workers, or some of them lack what the study needs or have
            other versions: each is named with the remedy, and no point is run.
    """
    if not isinstance(client, _distributed().Client) or client.asynchronous:
        what = "a distributed.Client that is not asynchronous"
        remedy = 'Client("tcp://node7:8786")'
        raise SceneError([Mistake("client", client, what, remedy=remedy)])
    study = with_absolute_path(study)
    here = environment_of(study)
    if here["fault"]:
        raise ClusterError(here["fault"])
    payload = _pickled(study, here)
    check_workers(client, here, payload)
    points, index = np.asarray(points, dtype=float), np.asarray(index, dtype=np.int64)
    return _run(client, payload, points, index, chunk, retries)


def check_workers(client: Any, here: Environment, payload: bytes) -> None:
    """Check, before any point is run, that all workers have what the study needs.

    Args:
        client: of their scheduler.
        here: environment of this process.
        payload: pickled: the study, ``here``.

    Raises:
        ClusterError: there are no workers, or some cannot run the study; names them.
    """
    answers = _answers(client, payload)
    version = here["versions"]["dap3d"]
    remedy = f"install dap3d {version} in its environment, as here"
    unfit = []
    for worker, answer in sorted(answers.items()):
        faults = [f"dap3d {version} cannot be used there ({answer}); {remedy}"]
        if not isinstance(answer, BaseException):
            faults = differences(here, answer)
        if faults:
            unfit.append(f"{worker}: {'; '.join(faults)}")
    if unfit:
        more = [f"... and {len(unfit) - MAX_NAMES} more"] if len(unfit) > MAX_NAMES else []
        title = f"{len(unfit)} of {len(answers)} workers cannot run this study:"
        raise ClusterError("\n".join([title, *unfit[:MAX_NAMES], *more]))


def _answers(client: Any, payload: bytes) -> dict[str, Any]:
    """The environment of each worker, or the exception that it raised, by address.

    Workers that are lost meanwhile have no say; where all are, others are waited for.
    """
    while True:
        with _requests(client):
            try:
                client.wait_for_workers(1, timeout=ARRIVAL)
            except TimeoutError as error:
                address = _address(client)
                raise ClusterError(
                    f"the scheduler at {address} has no workers; start some with "
                    f"`dask worker {address}`"
                ) from error
            answers = client.run(environment_there, current_versions(), payload, on_error="return")
            present = client.nthreads()
        found = {
            worker: answer
            for worker, answer in answers.items()
            if not _is_lost(answer, worker in present)
        }
        if found:
            return found


def _is_lost(answer: Any, is_present: bool) -> bool:
    """True for the answer of a worker that ended before it could give one."""
    closed = _distributed().comm.CommClosedError
    return isinstance(answer, closed) or (isinstance(answer, OSError) and not is_present)


def environment_there(versions: dict[str, str], payload: bytes) -> Environment:
    """The environment of this process, a worker.

    Args:
        versions: of the client; where Python or dap3d differ, nothing is unpickled.
        payload: pickled: the study, the environment of the client.
    """
    environment = bare_environment()
    if not version_differences(versions, environment["versions"]):
        import cloudpickle

        try:
            return environment_of(cloudpickle.loads(payload)[0])
        except Exception as error:  # of a missing module: whatever it raises
            environment["fault"] = (
                f"it cannot load the study ({type(error).__name__}: {error}); functions among the "
                "outputs must be defined in the script, or in a module that can be imported there"
            )
    return environment


def _run(
    client: Any, payload: bytes, points: Floats, index: Integers, chunk: int | None, retries: int
) -> Iterator[RunPoints]:
    name = f"dap3d-{uuid.uuid4().hex[:12]}"
    digest = hashlib.sha256(payload).hexdigest()
    # A task that returns the study, and no scattered data: dask makes it again where the worker
    # that had it is lost. Each worker gets it once.
    with _requests(client):
        study = client.submit(bytes, payload, key=f"{name}-study", pure=False)
    done = _distributed().as_completed(loop=client.loop, with_results=True, raise_errors=False)
    chunks, monitor = ChunkSize(TASK_SECONDS, 1), _ClusterMonitor(client)
    waiting: dict[Any, Integers] = {}
    try:
        while waiting or len(index):
            chunks.workers = monitor.cores
            while len(index) and len(waiting) < 2 * chunks.workers:
                size = chunk or chunks.next(len(index))
                part, index = index[:size], index[size:]
                task = run_points, study, digest, points[part]
                with _requests(client):
                    future = client.submit(
                        *task, key=f"{name}-{part[0]}", retries=retries, pure=False
                    )
                waiting[future] = part
                done.add(future)
            monitor.wait(done)
            future, outcome = next(done)
            part = waiting.pop(future)
            # Not by the state of the future: a worker may be lost after its result was fetched.
            if not (isinstance(outcome, tuple) and isinstance(outcome[0], Batch)):
                _raise(client, outcome, part)
            batch, seconds = outcome
            chunks.update(len(part), seconds)
            del future, outcome  # or the cluster would keep the result
            yield part, batch
    finally:
        if client.status == "running":
            with suppress(ClusterError), _requests(client):
                client.cancel([*waiting, study])


class _ClusterMonitor:
    """Polls a cluster.

    Attributes:
        cores: threads of all workers, from 1.
    """

    def __init__(self, client: Any) -> None:
        self.client, self.cores = client, 1
        self._seen = self._next = time.monotonic()
        self._poll()

    def wait(self, done: Any) -> None:
        """Wait until a task has ended.

        Raises:
            ClusterError: there have been no workers for some time, or the scheduler is gone.
        """
        while not done.has_ready():
            if self.client.status != "running":  # then dask may never report a task again
                raise _gone(self.client)
            self._poll()
            time.sleep(0.01)
        self._poll()

    def _poll(self) -> None:
        now = time.monotonic()
        if now < self._next or self.client.status != "running":
            return
        self._next = now + POLL_SECONDS
        try:
            cores = sum(self.client.nthreads().values())
        except OSError as error:  # the client most likely notices soon that nobody is there
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
    """The task of a worker: run points. Returns their outputs and the seconds they took."""
    return timed_run(_ensemble(payload, digest), points)


#: Compiled studies of a worker's process by their digest, the last one used at the end.
_ensembles: OrderedDict[str, Ensemble] = OrderedDict()
_lock = Lock()


def _ensemble(payload: bytes, digest: str) -> Ensemble:
    """The compiled study, compiled once in a process."""
    with _lock:
        if digest not in _ensembles:
            import cloudpickle

            study, there = cloudpickle.loads(payload)
            # a worker that came after all had been checked
            if faults := differences(there, environment_of(study)):
                address = _distributed().get_worker().address
                raise ClusterError(f"{address} cannot run this study: {'; '.join(faults)}")
            _ensembles[digest] = Ensemble(study)
            while len(_ensembles) > MAX_ENSEMBLES:
                _ensembles.popitem(last=False)
        _ensembles.move_to_end(digest)
        return _ensembles[digest]


def _raise(client: Any, outcome: Any, part: Integers) -> NoReturn:
    """Raise the error of a task that has no result."""
    error = outcome[1] if isinstance(outcome, tuple) else outcome
    if isinstance(error, _distributed().KilledWorker):
        raise ClusterError(
            f"a task of {len(part)} points, from index {part[0]} on, has ended each worker that "
            f"ran it, the last one {error.last_worker.address}: its log says why (often there was "
            "not enough memory)"
        ) from error
    if not isinstance(outcome, tuple):  # cancelled
        if client.status != "running":
            raise _gone(client) from error
        raise ClusterError(
            f"the scheduler at {_address(client)} has dropped the tasks: somebody has cancelled "
            "them"
        ) from error
    raise error.with_traceback(outcome[2])


@contextmanager
def _requests(client: Any) -> Iterator[None]:
    """Requests to the scheduler; ClusterError where it is gone."""
    try:
        yield
    except Exception as error:  # of a client that has closed meanwhile: a type of its own
        if isinstance(error, OSError) or client.status != "running":
            raise _gone(client) from error
        raise


def _gone(client: Any) -> ClusterError:
    return ClusterError(f"the scheduler at {_address(client)} is gone")


def _pickled(study: Study, here: Environment) -> bytes:
    """The study and its environment; functions of the script by value."""
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
            "pip install cloudpickle dask distributed"
        ) from error
    return distributed


def environment_of(study: Study) -> Environment:
    """The environment of this process, for a study."""
    environment = bare_environment()
    registry = load_registry()
    digests: dict[str, str] = {}
    try:
        checked = check(study.scene, registry, allow_code=study.allow_code)
        registry, digests = checked.registry, digests_of(checked)
    except (SceneError, PluginError) as error:
        environment["fault"] = str(error)
    types = environment["types"] = {}
    for kind in GROUPS:
        elements = getattr(study.scene, f"{kind}s").values()
        for keyword in sorted({e.type for e in elements if isinstance(e.type, str)}):
            if registry.sources_of(kind, keyword):
                types[f"{kind} {keyword}"] = _origin(registry, kind, keyword, digests)
    return environment


def bare_environment() -> Environment:
    """The environment as far as it is known without a study."""
    sources = driver_digest("study")
    return {"versions": current_versions(), "sources": sources, "types": None, "fault": ""}


def differences(here: Environment, there: Environment) -> list[str]:
    """Reasons why another process cannot run the study as this one does, each with a remedy."""
    if other := version_differences(here["versions"], there["versions"]):
        return other
    if there["types"] is None:
        return [there["fault"]]
    compared = (
        _type_difference(name, expected, there["types"].get(name))
        for name, expected in here["types"].items()
    )
    of_types = [message for message in compared if message]
    if not of_types and here["sources"] != there["sources"]:
        of_types = [f"its dap3d {there['versions']['dap3d']} has other sources; install the same"]
    return of_types or ([there["fault"]] if there["fault"] else [])


def version_differences(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """Differences of versions that keep processes apart, each with the remedy."""
    messages = []
    if here["python"].split(".")[:2] != there["python"].split(".")[:2]:
        messages.append(f"it has Python {there['python']}, here is {here['python']}; take the same")
    if here["dap3d"] != there["dap3d"]:
        version = here["dap3d"]
        messages.append(
            f"it has dap3d {there['dap3d']}, here is {version}; install {version} there, as here"
        )
    return messages


def with_absolute_path(study: Study) -> Study:
    """The study with the absolute path of its scene: other processes have other folders."""
    path = study.scene.path
    if path is None or path.is_absolute():
        return study
    scene = study.scene.copy()
    scene.path = path.absolute()
    return attrs.evolve(study, scene=scene)


def _origin(registry: Registry, kind: str, keyword: str, digests: dict[str, str]) -> dict[str, str]:
    source = registry.sources_of(kind, keyword)[0]
    return {
        "package": source.distribution,
        "version": source.version,
        "module": source.module,
        "digest": digests.get(f"{kind} {keyword}", ""),
    }


def _type_difference(name: str, here: dict[str, str], there: dict[str, str] | None) -> str:
    """The fault of one type in another process; "" where there is none."""
    kind, _, keyword = name.partition(" ")
    package, version = here["package"], here["version"]
    if not there:
        if not package:
            return (
                f"the {kind} type {keyword!r} is in {here['module']}, which it does not see; "
                f"let it see the folder {os.path.dirname(here['module'])} under this very path"
            )
        return (
            f"it lacks the {kind} type {keyword!r} of {package} {version}; "
            f"pip install {package}=={version} there"
        )
    if (there["package"], there["version"]) != (package, version):
        return (
            f"its {kind} type {keyword!r} is of {there['package'] or there['module']} "
            f"{there['version']}, here of {package or here['module']} {version}; install the same"
        )
    if there["digest"] and there["digest"] != here["digest"]:
        return f"the file of its {kind} type {keyword!r} is not the one here; install the same"
    return ""
