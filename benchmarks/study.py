"""Points of a study: what threads and processes gain, and what a task of a cluster costs.

Wall time, the least of many short rounds in turn: what others do on the machine only adds. Beside
it stands what the machine gave meanwhile, by two threads of plain hashing; and the work of two in
seconds of a core, as a part of that of one, which others hardly change.
"""

import hashlib
import os
import pickle
import threading
import time
import warnings

import numpy as np
import scenes

import dap3d_core as dap
from dap3d_core.study import Ensemble, Study, outputs_of
from dap3d_core.study.workers.dask_cluster import run_on
from dap3d_core.study.workers.threads import run_here

#: Seconds of the points of a round, and of all rounds of a case.
ROUND_SECONDS, SECONDS = 0.5, 30.0
#: Points of a task, and how many tasks of each size.
SIZES, TASKS = (1, 10, 100, 1000), 10
#: What is hashed: some 0.1 s.
BYTES = bytes(40_000_000)


def pendulum():
    """One body: a point of a study at its smallest."""
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", mass=1.0, Jp=(0.01, 0.01, 0.01), r=(0.5, 0.0, 0.0))
    scene.add_point("end", "bob", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight")
    return _study(scene, ("bodies.bob.mass", "bodies.bob.w.y"), "bob.r.z:min")


def rods():
    """Ten rods; their numbers are copied to their places."""
    return _study(scenes.chain(10), ("bodies.b0.mass", "bodies.b9.mass"), "b9.r.z:min")


def modelled():
    """Ten rods with an attachment that moves: each point has a model of its own, made in Python."""
    return _study(scenes.chain(10), ("points.out9.sPp.x", "bodies.b9.w.x"), "b9.r.z:min")


def _study(scene, names, output):
    scene.simulation.t_end, scene.simulation.dt = 1.0, 0.02
    return Study(scene, names, outputs_of([output]))


def points_of(study, count):
    """(count, 2) points near the scene's own numbers."""
    numbers = Ensemble(study).parameters
    middle = np.array([number.value for number in numbers])
    return middle + np.random.default_rng(0).uniform(0.0, 0.2, (count, len(middle)))


def measure():
    """Rows of the table."""
    return [*threads(), *processes(), *tasks()]


def _points_of_a_round(study):
    """So many points that one core has ROUND_SECONDS to do."""
    ensemble, points = Ensemble(study), points_of(study, 20)
    ensemble.run(points)
    begun = time.process_time()
    ensemble.run(points)
    count = round(20 * ROUND_SECONDS / (time.process_time() - begun))
    return ensemble, points_of(study, max(40, count))


def threads():
    """One thread beside two, in one process."""
    rows = []
    for case in (pendulum, rods, modelled):
        ensemble, points = _points_of_a_round(case())
        places = np.arange(len(points))
        wall, core = _least(
            [
                lambda n=n, e=ensemble, p=points, w=places: _drain(run_here(e, p, w, threads=n))
                for n in (1, 2)
            ],
            time.process_time,
        )
        rows.append(_row(f"{case.__name__}, threads", len(points), wall, core))
    return rows


def processes():
    """One worker of a cluster on this machine beside two, of one thread each."""
    import psutil
    from distributed import Client, LocalCluster

    rows = []
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with (
        warnings.catch_warnings(action="ignore"),
        LocalCluster(n_workers=1, **options) as first,
        LocalCluster(n_workers=2, **options) as second,
        Client(first) as one,
        Client(second) as two,
    ):
        workers = [psutil.Process(p) for c in (one, two) for p in c.run(os.getpid).values()]

        def of_a_core():
            return sum(sum(worker.cpu_times()[:2]) for worker in workers)

        for case in (pendulum, rods):
            study = case()
            points = np.repeat(_points_of_a_round(study)[1], 4, axis=0)
            places = np.arange(len(points))
            ways = [
                lambda c=c, s=study, p=points, w=places: _drain(run_on(c, s, p, w))
                for c in (one, two)
            ]
            wall, core = _least(ways, of_a_core, 2.0 * SECONDS)
            rows.append(_row(f"{case.__name__}, processes", len(points), wall, core))
    return rows


def tasks():
    """What a task costs beside its points, and what is sent, by the number of its points."""
    from distributed import Client, LocalCluster

    study, rows = pendulum(), []
    ensemble = Ensemble(study)
    with (
        warnings.catch_warnings(action="ignore"),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        for size in SIZES:
            points = points_of(study, size * TASKS)
            places = np.arange(len(points))
            there = lambda p=points, w=places, s=size: _drain(run_on(client, study, p, w, chunk=s))  # noqa: E731
            here = lambda p=points: ensemble.run(p)  # noqa: E731
            least = lambda w=places: _drain(run_on(client, study, points_of(study, 1), w[:1]))  # noqa: E731
            (far, near, start, *_), _ = _least(
                [there, here, least], time.process_time, 0.5 * SECONDS
            )
            batch = ensemble.run(points[:size])
            rows.append(
                {
                    "case": f"tasks of {size}",
                    "task_ms": 1e3 * near / TASKS,
                    "task_overhead_ms": 1e3 * (far - near - start) / TASKS,
                    "bytes_sent": len(pickle.dumps(points[:size])),
                    "bytes_back": len(pickle.dumps(batch)),
                }
            )
    return rows


def _hash(count):
    """Hash BYTES twice, in one thread or two."""

    def work():
        for _ in range(2 // count):
            hashlib.sha256(BYTES).digest()

    workers = [threading.Thread(target=work) for _ in range(count)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()


def _drain(found):
    for _ in found:
        pass


def _least(ways, of_a_core, seconds=SECONDS):
    """Least wall seconds and least seconds of cores of each way, and of hashing, in turn."""
    ways = [*ways, lambda: _hash(1), lambda: _hash(2)]
    wall, core = np.full(len(ways), np.inf), np.full(len(ways), np.inf)
    for way in ways:
        way()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        for k, way in enumerate(ways):
            begun, worked = time.perf_counter(), of_a_core()
            way()
            wall[k] = min(wall[k], time.perf_counter() - begun)
            core[k] = min(core[k], of_a_core() - worked)
    return wall, core


def _row(case, count, wall, core):
    return {
        "case": case,
        "points": count,
        "us_a_point": float(1e6 * wall[0] / count),
        "gain_of_two": float(wall[0] / wall[1]),
        "gain_of_hashing": float(wall[-2] / wall[-1]),
        "work_of_two": float(core[1] / core[0]),
    }
