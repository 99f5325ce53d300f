"""Studies on a cluster: a real scheduler and real workers, processes of their own."""

import gc
import importlib.util
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import attrs
import numpy as np
import pytest
from support.studies import POINTS, bob, collected, same

import dap3d_core as dap
from dap3d_core.study import Ensemble, PointStatus
from dap3d_core.study.workers import dask_cluster
from dap3d_core.study.workers.dask_cluster import differences, environment_of, with_absolute_path
from dap3d_core.study.workers.threads import run_here

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("distributed") is None, reason="the extra cluster is not installed"
    ),
    # of distributed itself: sockets and loops of clusters that are closed
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
COUNT = 60
PLACES = np.arange(COUNT)


@contextmanager
def two_workers():
    import distributed  # takes a second, which those who run the quick tests need not wait

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def client():
    """Of two workers, processes with one thread each."""
    with two_workers() as client:
        yield client


@pytest.fixture(scope="module")
def alone():
    """What the points of the pendulum give in this process, in one thread."""
    return collected(run_here(Ensemble(bob()), POINTS, PLACES, threads=1))


@contextmanager
def another_worker(client, **variables):
    """One more worker, with other variables of the environment; its address."""
    there = set(client.nthreads())
    with worker_of(client.scheduler.address, **variables):
        client.wait_for_workers(len(there) + 1, timeout=60)
        yield (set(client.nthreads()) - there).pop()
    wait_until(lambda: set(client.nthreads()) <= there)


@contextmanager
def worker_of(address, **variables):
    """A worker of a scheduler; in the end it is killed.
    As clusters lose workers; SIGTERM waits for a loop that may be busy."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    process = subprocess.Popen(
        [*command, "--no-dashboard", "--no-nanny", "--nthreads", "1"],
        env=os.environ | variables, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield
    finally:
        process.kill()
        process.wait(30)


def wait_until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_numbers_are_those_of_one_process(client, alone):
    """Bit for bit, with sizes of tasks by the clock and given ones; in the end both workers have
    taken part, each of which has compiled the study once for all its tasks."""
    same(alone, collected(dask_cluster.run_on(client, bob(), POINTS, PLACES)))
    same(alone, collected(dask_cluster.run_on(client, bob(), POINTS, PLACES, chunk=7)))
    some = np.array([40, 3, 11])
    found = collected(dask_cluster.run_on(client, bob(), POINTS, some))
    same({k: alone[k] for k in sorted(found)}, dict(sorted(found.items())))
    assert list(dask_cluster.run_on(client, bob(), POINTS, PLACES[:0])) == []

    def kept():
        collected(dask_cluster.run_on(client, bob(), POINTS, PLACES, chunk=1))
        found = client.run(
            lambda: len(sys.modules["dap3d_core.study.workers.dask_cluster"]._ensembles)
        )
        return list(found.values())

    wait_until(lambda: kept() == [1, 1], 100.0)  # a worker may have been slow to begin


def test_nothing_is_left_on_the_cluster(client):
    """After the end, and where nobody asks for the rest."""
    collected(dask_cluster.run_on(client, bob(), POINTS, PLACES))
    wait_until(lambda: not client.who_has())
    found = dask_cluster.run_on(client, bob(), POINTS, np.arange(200), chunk=1)
    next(found)
    found.close()
    wait_until(lambda: not any(client.processing().values()))
    wait_until(lambda: not client.who_has())


def test_functions_of_the_script_are_sent(client, tmp_path, monkeypatch):
    """By value; one of a module that workers have not is named, with what to do."""
    asked = {"lowest": "bob.r.z:min", "fastest": lambda result: abs(result.w).max()}
    study = bob(asked)
    same(
        collected(run_here(Ensemble(study), POINTS, PLACES[:8], threads=1)),
        collected(dask_cluster.run_on(client, study, POINTS, PLACES[:8])),
    )
    (tmp_path / "mine.py").write_text("def lowest(result):\n    return result.r[:, 0, 2].min()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    elsewhere = bob({"lowest": importlib.import_module("mine").lowest})
    with pytest.raises(dask_cluster.ClusterError, match="2 of 2 workers") as error:
        dask_cluster.run_on(client, elsewhere, POINTS, PLACES)
    assert "functions among the outputs must be defined in the script" in str(error.value)


def test_a_point_that_fails_is_no_task_that_fails(client):
    """It has its status and note, and the others their numbers, as in one process."""
    points = POINTS[:6].copy()
    points[2, 0] = -1.0  # kg
    study, places = bob(), np.arange(6)
    found = collected(dask_cluster.run_on(client, study, points, places, chunk=3))
    same(collected(run_here(Ensemble(study), points, places, threads=1)), found)
    status = [found[k][0] for k in places]
    assert status == [PointStatus.DONE] * 2 + [PointStatus.FAILED] + [PointStatus.DONE] * 3
    assert "mass" in found[2][1]


def test_a_worker_that_is_killed_loses_nothing(alone):
    """By SIGKILL, in the middle; what it had is done by the others, and nothing comes twice."""
    with two_workers() as client:
        found, parts = dask_cluster.run_on(client, bob(), POINTS, PLACES, chunk=2), []
        parts += [next(found) for _ in range(3)]
        victim = next(iter(client.run(os.getpid).values()))
        os.kill(victim, signal.SIGKILL)
        parts += list(found)
        same(alone, dict(sorted(collected(parts).items())))


@pytest.mark.long
def test_a_worker_that_is_lost_while_it_reports_its_versions_has_no_say(client, alone):
    """It hangs in the middle of the question and dies: the points are computed by the others."""
    with another_worker(client) as address:
        (pid,) = client.run(os.getpid, workers=[address]).values()
        os.kill(pid, signal.SIGSTOP)
        threading.Timer(1.0, os.kill, (pid, signal.SIGKILL)).start()
        same(alone, collected(dask_cluster.run_on(client, bob(), POINTS, PLACES)))


@pytest.mark.long
def test_points_that_kill_their_workers_are_named():
    """Dask gives up after some workers, here one; the message says which points, where to look."""
    import dask

    def deadly(result):
        os.kill(os.getpid(), signal.SIGKILL)

    words = "a task of 1 points, from index 4 on, has ended each worker that ran it"
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        two_workers() as client,
        pytest.raises(dask_cluster.ClusterError, match=words),
    ):
        collected(dask_cluster.run_on(client, bob({"none": deadly}), POINTS, np.array([4])))


PUSH = """
from dap3d_core.interface import Body, Force, body, hookimpl, number

interface_version = 1


class Push(Force):
    keyword = "push"
    body_i: Body = body()
    k: float = number(default={k})

    def wrench(k):
        return (((k, 0.0, 0.0), (0.0, 0.0, 0.0)),)


@hookimpl
def dap3d_forces():
    return [Push]
"""


def package(folder, version, name="dap3d-push", k=1.0):
    """A plugin as its author would install it: a module and its metadata."""
    folder.mkdir()
    (folder / "dap3d_push_module.py").write_text(PUSH.format(k=k))
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text("[dap3d.forces]\npush = dap3d_push_module\n")
    return folder


def path(*folders):
    """PYTHONPATH with these folders first."""
    return os.pathsep.join([*map(str, folders), os.environ.get("PYTHONPATH", "")])


def pushed():
    """The pendulum with a force that only a plugin brings."""
    study = bob()
    study.scene.add_force("push", "p", body_i="bob")
    return study


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The plugin is installed here, not where the workers run."""
    folder = package(tmp_path / "here", "1.2")
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    sys.modules.pop("dap3d_push_module", None)


def test_workers_without_a_plugin_are_named(client, installed, tmp_path):
    """At once, all of them, with what is missing and what to do."""
    with pytest.raises(dask_cluster.ClusterError) as error:
        dask_cluster.run_on(client, pushed(), POINTS, PLACES)
    title, *lines = str(error.value).splitlines()
    assert title == "2 of 2 workers cannot run this study:"
    wanted = "it lacks the force type 'push' of dap3d-push 1.2; pip install dap3d-push==1.2 there"
    assert lines == [f"{worker}: {wanted}" for worker in sorted(client.nthreads())]


@pytest.mark.parametrize(
    ("version", "k", "words"),
    [
        ("1.2", 1.0, ""),
        ("1.3", 1.0, "its force type 'push' is of dap3d-push 1.3, here of dap3d-push 1.2"),
        ("1.2", 2.0, "the file of its force type 'push' is not the one here; install the same"),
    ],
)
def test_versions_of_plugins_are_compared(client, installed, tmp_path, version, k, words):
    """One worker has the plugin: the same, another version, the same version of another text."""
    there = package(tmp_path / "there", version, k=k)
    with another_worker(client, PYTHONPATH=path(there)) as address:
        with pytest.raises(dask_cluster.ClusterError) as error:
            dask_cluster.run_on(client, pushed(), POINTS, PLACES)
        lines = [line for line in str(error.value).splitlines() if line.startswith(address)]
        assert [line.partition(": ")[2][: len(words)] for line in lines] == [words] * bool(words)


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("dap3d-0.0.9.dist-info/METADATA",
         "Metadata-Version: 2.1\nName: dap3d\nVersion: 0.0.9\n",
         "it has dap3d 0.0.9, here is {0}; install {0} there, as here$"),
        ("dap3d_core.py", "raise ImportError('nothing here')", "dap3d .* as here"),
    ],
    ids=["another version", "none"],
)  # fmt: skip
def test_versions_of_dap3d_are_compared(client, tmp_path, file, text, words):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(text)
    with (
        another_worker(client, PYTHONPATH=path(tmp_path)) as address,
        pytest.raises(dask_cluster.ClusterError) as error,
    ):
        dask_cluster.run_on(client, bob(), POINTS, PLACES)
    title, line = str(error.value).splitlines()
    assert title == "1 of 3 workers cannot run this study:"
    version = dap.simulate("fourbar3", t_end=0.0).record.versions["dap3d"]
    assert re.match(f"{re.escape(address)}: {words.format(re.escape(version))}", line)


@pytest.mark.long
def test_a_worker_that_comes_late_is_asked_as_well(installed, tmp_path):
    """By its first task: it does not compute with formulas of its own."""
    late = package(tmp_path / "late", "1.2", k=2.0)
    with two_workers() as client:  # which look for modules where this process does
        first = list(client.nthreads())
        found = dask_cluster.run_on(client, pushed(), POINTS, np.arange(200), chunk=1, retries=0)
        next(found)
        with another_worker(client, PYTHONPATH=path(late)) as address:
            client.retire_workers(first)
            with pytest.raises(dask_cluster.ClusterError) as error:
                collected(found)
    assert str(error.value).startswith(f"{address} cannot run this study: the file of its force")


def test_types_of_the_model_itself_need_its_folder(client, tmp_path, monkeypatch):
    """Under the same path, also where the scene was named by a path from here."""
    folder = tmp_path / "pushed"
    folder.mkdir()
    (folder / "plugin.py").write_text(PUSH.format(k=1.0))
    pushed().scene.save(folder / "scene.toml")
    monkeypatch.chdir(tmp_path)
    study = attrs.evolve(bob(), scene=dap.load("pushed/scene.toml"), allow_code=True)
    assert not study.scene.path.is_absolute()
    same(
        collected(run_here(Ensemble(study), POINTS, PLACES[:8], threads=1)),
        collected(dask_cluster.run_on(client, study, POINTS, PLACES[:8], chunk=2)),
    )
    here = environment_of(with_absolute_path(study))
    (folder / "plugin.py").rename(folder / "gone.py")
    (unseen,) = differences(here, environment_of(with_absolute_path(study)))
    assert unseen == (
        f"the force type 'push' is in {folder / 'plugin.py'}, which it does not see; "
        f"let it see the folder {folder} under this very path"
    )


def test_who_does_not_answer_is_named():
    """Within the time given, in one sentence."""
    begun = time.monotonic()
    with pytest.raises(
        dask_cluster.ClusterError, match=r"no dask scheduler answers at tcp://127.0.0.1:9 "
    ):
        dask_cluster.connect("tcp://127.0.0.1:9", timeout=1.0)
    assert time.monotonic() - begun < 5.0
    for address in ("node", "http://127.0.0.1:80", ""):
        with pytest.raises(dask_cluster.ClusterError, match="no dask scheduler answers at"):
            dask_cluster.connect(address, timeout=1.0)


def test_a_port_that_accepts_and_says_nothing_is_not_waited_for():
    """A firewall, or another service: a client of dask would wait for ever."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        words = rf"answers at {address} \(no answer within 1 s\)"
        with pytest.raises(dask_cluster.ClusterError, match=words):
            dask_cluster.connect(address, timeout=1.0)


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_an_address_without_a_port_leaves_no_half_made_client():
    """One would print a traceback when it is collected."""
    with pytest.raises(dask_cluster.ClusterError, match="missing port number in address 'node7'"):
        dask_cluster.connect("node7", timeout=1.0)
    gc.collect()


@pytest.mark.long
def test_workers_and_schedulers_that_are_gone(tmp_path, monkeypatch):
    """No workers at the start, none any more, and a scheduler that dies: each is one sentence."""
    for name, seconds in (("ARRIVAL", 0.5), ("ABSENCE", 0.5), ("POLL_SECONDS", 0.1)):
        monkeypatch.setattr(dask_cluster, name, seconds)
    file = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    process = subprocess.Popen(
        [*command, "--port", "0", "--scheduler-file", str(file)], stderr=subprocess.DEVNULL
    )
    try:
        wait_until(lambda: file.exists() and file.read_text().endswith("}"))
        address = json.loads(file.read_text())["address"]
        with dask_cluster.connect(address) as client:
            with pytest.raises(
                dask_cluster.ClusterError, match=f"has no workers.*dask worker {address}"
            ):
                dask_cluster.run_on(client, bob(), POINTS, PLACES)
            with worker_of(address):
                client.wait_for_workers(1, timeout=60)
                found = dask_cluster.run_on(client, bob(), POINTS, np.arange(200), chunk=1)
                next(found)
            with pytest.raises(
                dask_cluster.ClusterError, match=f"{address} has lost all its workers"
            ):
                collected(found)
            with worker_of(address):
                client.wait_for_workers(1, timeout=60)
                found = dask_cluster.run_on(client, bob(), POINTS, np.arange(200), chunk=1)
                next(found)
                monkeypatch.setattr(dask_cluster, "POLL_SECONDS", 0.0)  # it is asked when it dies
                process.kill()
                with pytest.raises(
                    dask_cluster.ClusterError, match=f"the scheduler at {address} is gone"
                ):
                    collected(found)
    finally:
        process.kill()
        process.wait(30)


def test_a_client_that_is_closed_meanwhile(client):
    """Nothing can be asked of it, nor be told to it; so is one that was closed before."""
    from distributed import as_completed

    with dask_cluster.connect(client.scheduler.address) as mine:
        found = dask_cluster.run_on(mine, bob(), POINTS, np.arange(200), chunk=1)
        next(found)
        watch, silent = dask_cluster._ClusterMonitor(mine), as_completed(loop=mine.loop)
        mine.close()
        with pytest.raises(dask_cluster.ClusterError, match=r"the scheduler at .* is gone"):
            collected(found)
        with pytest.raises(dask_cluster.ClusterError, match=r"the scheduler at .* is gone"):
            watch.wait(silent)  # of tasks that were being fetched dask does not speak any more
        with pytest.raises(dask_cluster.ClusterError, match=r"the scheduler at .* is gone"):
            dask_cluster.run_on(mine, bob(), POINTS, PLACES)


def test_what_is_no_client_is_refused(client):
    with pytest.raises(dap.SceneError, match=r"client = .*a distributed\.Client"):
        dask_cluster.run_on("tcp://127.0.0.1:8786", bob(), POINTS, PLACES)


def test_without_dask_there_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(dask_cluster.ClusterError, match="pip install cloudpickle dask distributed"):
        dask_cluster.connect("tcp://127.0.0.1:8786")
