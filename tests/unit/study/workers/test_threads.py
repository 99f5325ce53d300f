"""The points of a study on the cores of a machine."""

import os
import subprocess
import sys
import threading
import time

import attrs
import numpy as np
import pytest
from support.plain import in_another_process, jit_is_on, long_in_plain_python
from support.studies import POINTS, bob, collected, same

import dap3d_core as dap
from dap3d_core.study import Batch, Ensemble, PointStatus
from dap3d_core.study.workers import threads as local

POINTS_COUNT = 24 if jit_is_on() else 4


@pytest.fixture(scope="module")
def ensemble():
    return Ensemble(bob())


def ours():
    """The threads of studies that are alive."""
    return [t for t in threading.enumerate() if t.name == "dap3d-study"]


@pytest.mark.slow
@long_in_plain_python
def test_numbers_depend_neither_on_threads_nor_on_portions(ensemble):
    """Bit for bit: one thread, more threads than cores, all points at once, each by itself."""
    points, places = POINTS[:POINTS_COUNT], np.arange(POINTS_COUNT)
    one = collected(local.run_here(ensemble, points, places, threads=1))
    assert sorted(one) == list(range(POINTS_COUNT))
    for threads in (2, 3, None):
        same(one, collected(local.run_here(ensemble, points, places, threads=threads)))
    same(one, collected([(places, ensemble.run(points))]))
    same(one, collected((places[k : k + 1], ensemble.run(points[k : k + 1])) for k in places))
    assert not ours()


def test_only_the_given_points_are_run(ensemble):
    """In any order; none at all gives nothing."""
    points, places = POINTS[:9], np.array([7, 2, 5])
    found = collected(local.run_here(ensemble, points, places, threads=2))
    assert sorted(found) == [2, 5, 7]
    for k in found:
        same({k: found[k]}, collected([(np.array([k]), ensemble.run(points[k : k + 1]))]))
    assert list(local.run_here(ensemble, points, np.array([], dtype=int))) == []


@attrs.define
class Slow:
    """An ensemble that takes its time, and knows who used it."""

    seconds: float = 0.0
    fails_at: float = np.inf
    seen: list = attrs.Factory(list)

    def run(self, points):
        self.seen.append((threading.current_thread().name, len(points)))
        time.sleep(self.seconds * len(points))
        if (points[:, 0] >= self.fails_at).any():
            raise ValueError("a function of the user")
        status = np.full(len(points), PointStatus.DONE, dtype=np.int8)
        return Batch(status, [""] * len(points), {"mass": points[:, 0]})


@pytest.mark.parametrize(("threads", "count"), [(1, 30), (8, 1)])
def test_one_thread_or_one_point_makes_no_thread(threads, count):
    slow = Slow()
    found = local.run_here(slow, POINTS[:count], np.arange(count), threads=threads)
    assert len(collected(found)) == count
    assert {name for name, _ in slow.seen} == {threading.current_thread().name}


def test_chunks_follow_the_time_of_earlier_ones():
    """A chunk of 1000 quick points is followed by one long one; the last ones are small."""
    chunks = local.ChunkSize(0.2, 1)
    for size in (1, 16, 256):
        assert chunks.next(10**6) <= size
        chunks.update(size, size * 1e-4)
    assert chunks.next(10**6) == pytest.approx(2000, rel=0.01)
    chunks.workers = 2
    assert 100 <= chunks.next(1000) <= 250
    chunks.update(2000, 2000.0)
    assert chunks.next(10**6) == 1
    assert chunks.next(0) >= 0


def test_an_exception_comes_out_once_and_ends_the_others():
    """What was done before it is given; nobody works on afterwards."""
    points = np.column_stack([np.arange(200.0), np.zeros(200)])
    slow = Slow(0.002, fails_at=50.0)
    found = local.run_here(slow, points, np.arange(200), threads=2)
    done = []
    with pytest.raises(ValueError, match="a function of the user"):
        done.extend(len(places) for places, _ in found)
    assert 0 < sum(done) <= 150
    assert not ours()
    run = len(slow.seen)
    time.sleep(0.05)
    assert len(slow.seen) == run
    assert list(found) == []


@pytest.mark.parametrize("how", ["close", "Ctrl-C"])
def test_an_early_end_leaves_the_rest(how):
    slow = Slow(0.01)
    found = local.run_here(slow, np.zeros((500, 2)), np.arange(500), threads=2)
    next(found)
    if how == "close":
        found.close()
    else:
        with pytest.raises(KeyboardInterrupt):
            found.throw(KeyboardInterrupt)
    assert sum(size for _, size in slow.seen) < 250
    assert not ours()


@pytest.mark.slow
@long_in_plain_python
def test_an_early_end_does_not_wait_for_a_long_point(monkeypatch):
    """Its thread runs it to its end, begins no other one and does not keep the process alive."""
    monkeypatch.setattr(local, "PATIENCE", 0.01)
    slow = Slow(0.5)
    found = local.run_here(slow, POINTS[:20], np.arange(20), threads=2)
    next(found)
    found.close()
    left, run = ours(), len(slow.seen)
    assert left
    assert all(thread.daemon for thread in left)
    for thread in left:
        thread.join(5.0)
    assert not ours()
    assert len(slow.seen) == run


def test_the_environment_limits_threads(monkeypatch):
    """DAP3D_THREADS, also of requested threads; invalid values are refused."""
    monkeypatch.setenv("DAP3D_THREADS", "1")
    slow = Slow()
    collected(local.run_here(slow, POINTS[:8], np.arange(8), threads=4))
    assert {name for name, _ in slow.seen} == {threading.current_thread().name}
    monkeypatch.setenv("DAP3D_THREADS", "none")
    with pytest.raises(dap.SimulationError, match="DAP3D_THREADS is 'none'; it must be a whole"):
        local.run_here(slow, POINTS[:8], np.arange(8))


@pytest.mark.parametrize("threads", [0, -2, 1.5, "two", True])
def test_what_is_no_number_of_threads_is_refused(ensemble, threads):
    with pytest.raises(dap.SceneError, match=r"threads = .*a whole number from 1"):
        local.run_here(ensemble, POINTS[:2], np.arange(2), threads=threads)


@in_another_process
@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_sweep_in_a_forked_process_after_one_with_threads_ends():
    """No lock or thread of the parent is missed by the child, at the end of a sweep or within."""
    script = """
import os
import dap3d_core as dap

scene = dap.load("pen1")
body = next(iter(scene.bodies))

def sweep(**more):
    data = dap.sweep(scene, {f"bodies.{body}.mass": "1:2:8"}, outputs=["energy.total:end"],
                     t_end=0.1, threads=2, **more)
    return float(data["energy.total:end"].sum())

def forked():
    child = os.fork()
    if not child:
        os._exit(sweep() != expected)
    return child

expected = sweep()
children = [forked()]
sweep(progress=lambda done, total: children.append(forked()) if len(children) < 2 else None)
for child in children:
    assert os.waitpid(child, 0)[1] == 0
"""
    command = [sys.executable, "-W", "ignore", "-c", script]
    assert subprocess.run(command, timeout=120, check=False).returncode == 0
