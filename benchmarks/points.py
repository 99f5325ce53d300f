"""A point of a study: what it costs beside its integration.

Time of this thread, the least of several rounds in turn: what else runs on the machine does not
count. The integration alone is the same one, started again and again by its own compiled call.
"""

import time

import numpy as np
import scenes
from support.studies import pendulum

import dap3d_core as dap
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.study import Ensemble, Study, outputs_of

ROUNDS, POINTS = 9, 320


def flight():
    """A stone on a spring: no joints."""
    scene = dap.Scene(name="flight")
    scene.add_body("stone", mass=1.0, Jp=(0.1, 0.2, 0.3), r=(1.0, 0.0, 0.0), w=(1.0, 2.0, 3.0))
    scene.add_force("ptp", "spring", P_i="stone.O", P_j="ground.O", k=10.0, l0=0.5)
    return scene


def chain():
    """Ten rods on revolute joints."""
    return scenes.chain(10)


def in_joint_coordinates(make):
    """The same scene by method joint."""

    def made():
        scene = make()
        scene.simulation.method = "joint"
        return scene

    return made


#: What varies: scene, name, least and greatest value, output.
CASES = {
    "stiffness of a free body": (flight, "forces.spring.k", 9.0, 11.0, "stone.r.x"),
    "start of a free body": (flight, "bodies.stone.r_dot.y", 0.0, 1.0, "stone.r.x"),
    "mass, one revolute": (pendulum, "bodies.bob.mass", 1.0, 1.2, "bob.r.z"),
    "stiffness, extreme": (pendulum, "forces.spring.k", 9.0, 11.0, "bob.r.z:max"),
    "length, start corrected": (pendulum, "points.end.sPp.x", -0.6, -0.5, "bob.r.z"),
    "mass, ten rods": (chain, "bodies.b9.mass", 1.0, 1.2, "b9.r.z"),
    "joint: mass, one revolute": (
        in_joint_coordinates(pendulum), "bodies.bob.mass", 1.0, 1.2, "bob.r.z"),
    "joint: stiffness, extreme": (
        in_joint_coordinates(pendulum), "forces.spring.k", 9.0, 11.0, "bob.r.z:max"),
    "joint: speed, start corrected": (
        in_joint_coordinates(pendulum), "bodies.bob.w.y", 0.0, 1.0, "bob.r.z"),
    "joint: length, modelled": (
        in_joint_coordinates(pendulum), "points.end.sPp.x", -0.6, -0.5, "bob.r.z"),
    "joint: mass, ten rods": (in_joint_coordinates(chain), "bodies.b9.mass", 1.0, 1.2, "b9.r.z"),
}  # fmt: skip


def measure():
    """Rows of the table."""
    return [_row(name, *case) for name, case in CASES.items()]


def _row(case, make, name, low, high, output):
    scene = make()
    scene.simulation.t_end, scene.simulation.dt = 1.0, 0.02
    points = np.linspace(low, high, POINTS)[:, None]
    least = {}

    of = Ensemble(Study(scene, (name,), outputs_of([output])))
    of.run(points[:32])
    for _ in range(ROUNDS):
        _keep(least, "point", _seconds(lambda: of.run(points)) / POINTS)
        _keep(least, "simulate", _seconds(lambda: of.result(points[0])))
    short = _overhead(scene, name, points, output)
    return {
        "case": case,
        "point_us": 1e6 * least["point"],
        "overhead_us": 1e6 * short,
        "compile_and_simulate": least["simulate"] / least["point"],
    }


def _overhead(scene, name, points, output):
    """What a point costs beside its integration, measured where that is short: some steps."""
    scene.simulation.t_end, scene.simulation.dt = 0.02, 0.01
    of = Ensemble(Study(scene, (name,), outputs_of([output])))
    many = np.tile(points, (5, 1))
    of.run(many[:3])
    runs = of._runner().compiled_batch
    integration, work = runs.integration, runs.integration.work
    fresh = [array.copy() for array in integration.state_arrays()]
    numbers = runs.constants["first_real"], runs.constants["first_integer"]
    least = {}
    for _ in range(ROUNDS):
        _keep(least, "point", _seconds(lambda: of.run(many)) / len(many))
        alone, call = [], []
        for _ in range(200):
            for array, before in zip(integration.state_arrays(), fresh, strict=True):
                array[...] = before
            work.real[:], work.integer[:] = numbers
            work.state[Y] = runs.last_start
            alone.append(_wall(lambda: integration.advance(10**9)))
            call.append(_wall(lambda: integration.advance(10**9)))  # it has ended: the call alone
        _keep(least, "alone", float(np.median(alone) - np.median(call)))
    return least["point"] - least["alone"]


def _keep(least, key, seconds):
    least[key] = min(seconds, least.get(key, np.inf))


def _seconds(do):
    begun = time.thread_time()
    do()
    return time.thread_time() - begun


def _wall(do):
    begun = time.perf_counter()
    do()
    return time.perf_counter() - begun
