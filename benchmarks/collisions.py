"""Time stepping of contacts: creep, overlap and order, and CPU time a step.

    python benchmarks/collisions.py [SPHERES]

The scenes are those of tests/verification/test_stepping.py, over longer times; and a pile of 1000
spheres, or so many, that fall into a box.
"""

import sys
import time
from pathlib import Path

import numpy as np

import dap3d_core as dap

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from verification.test_stepping import G, ball, collide, slope, tower

#: Radius of a sphere, m.
R = 0.05


def timed(scene, **settings):
    """A run, and its CPU time, s, without that of compiling."""
    compiled = dap.compile(scene)
    dap.simulate(compiled, **settings | {"t_end": 2.0 * settings["contact_step"], "dt": None})
    start = time.process_time()
    result = dap.simulate(compiled, **settings)
    return result, time.process_time() - start


def spheres(count):
    """Spheres above the floor of a box."""
    scene, rng, side = dap.Scene(name="spheres"), np.random.default_rng(0), 10
    width = 2.2 * R * side
    for k in range(count):
        place = np.array([k % side, k // side % side, k // side**2]) + 0.5
        r = 2.2 * R * place + 0.1 * R * rng.uniform(-1.0, 1.0, 3)
        scene.add_body(f"ball{k}", mass=1.0, Jp=[0.4 * R * R] * 3, r=r)
        scene.add_shape("sphere", body=f"ball{k}", radius=R, collides=True)
    for at, normal in (([0, 0, 0], [1, 0, 0]), ([0, 0, 0], [0, 1, 0]),
                       ([width, 0, 0], [-1, 0, 0]), ([0, width, 0], [0, -1, 0])):  # fmt: skip
        scene.add_shape("plane", body="ground", at=at, normal=normal, collides=True)
    return collide(scene, mu=0.5)


def measure(count=1000):
    """Rows of the table: what, figure, unit."""
    rows = [*resting(), *rolling(), *piling(count)]
    return [dict(zip(("measure", "found", "unit"), row, strict=True)) for row in rows]


def resting():
    """What should stand, by steps of 5 ms."""
    result, seconds = timed(slope(), t_end=60.0, dt=1.0, contact_step=5e-3)
    yield "slope, 60 s: creep", float(np.abs(result.r - result.r[0]).max()), "m"
    yield "slope: a step", seconds / 12e3 * 1e3, "ms"
    result, seconds = timed(tower(), t_end=10.0, dt=0.5, contact_step=5e-3)
    z = result.r[-1, :, 2]
    yield "tower, 10 s: moved", float(np.abs(result.r - result.r[0]).max()), "m"
    yield "tower: overlap", float(-min(z[0] - 0.05, (np.diff(z) - 0.1).min())), "m"
    yield "tower: a step", seconds / 2e3 * 1e3, "ms"


def rolling():
    """A ball that slides, then rolls, against its closed form."""
    v0, mu = 3.0, 0.3
    end = 2.0 / 7.0 * v0 / (mu * G)
    exact = v0 * end - 0.5 * mu * G * end**2 + 5.0 / 7.0 * v0 * (1.0 - end)
    for h in (4e-3, 1e-3):
        result, _ = timed(ball(mu=mu), t_end=1.0, dt=0.5, contact_step=h)
        yield f"slides, then rolls, {1e3 * h:g} ms", float(abs(result.r[-1, 0, 0] - exact)), "m"


def piling(count):
    """Spheres that fall into a box."""
    settings = {"dt": 0.1, "contact_step": 4e-3, "rtol": 1e-4}
    for t_end in (0.1, 0.5):
        result, seconds = timed(spheres(count), t_end=t_end, **settings)
        what, found = f"{count} spheres, {t_end:g} s", result.record.stepping
        yield f"{what}: a step on average", seconds / t_end * 4.0, "ms"
        yield f"{what}: residual", float(found["largest_residual"]), "of the largest impulse"
        yield f"{what}: overlap", float(found["deepest"]), "m"


if __name__ == "__main__":
    for row in measure(*map(int, sys.argv[1:])):
        print(f"{row['measure']}: {row['found']:.2g} {row['unit']}", flush=True)
