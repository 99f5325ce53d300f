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


def main(count=1000):
    """Print a line for each scene."""
    result, seconds = timed(slope(), t_end=60.0, dt=1.0, contact_step=5e-3)
    moved = np.abs(result.r - result.r[0]).max()
    print(f"slope, 60 s: creep {moved:.1e} m, {seconds / 12e3 * 1e3:.2f} ms a step", flush=True)
    result, seconds = timed(tower(), t_end=10.0, dt=0.5, contact_step=5e-3)
    moved, z = np.abs(result.r - result.r[0]).max(), result.r[-1, :, 2]
    overlap = -min(z[0] - 0.05, (np.diff(z) - 0.1).min())
    print(f"tower, 10 s: moved {moved:.1e} m, overlap {overlap:.1e} m, "
          f"{seconds / 2e3 * 1e3:.2f} ms a step", flush=True)  # fmt: skip
    v0, mu = 3.0, 0.3
    end = 2.0 / 7.0 * v0 / (mu * G)
    exact = v0 * end - 0.5 * mu * G * end**2 + 5.0 / 7.0 * v0 * (1.0 - end)
    for h in (4e-3, 1e-3):
        result, _ = timed(ball(mu=mu), t_end=1.0, dt=0.5, contact_step=h)
        print(f"slides, then rolls, {1e3 * h:g} ms: {abs(result.r[-1, 0, 0] - exact):.1e} m")
    settings = {"dt": 0.1, "contact_step": 4e-3, "rtol": 1e-4}
    for t_end in (0.1, 0.5):
        result, seconds = timed(spheres(count), t_end=t_end, **settings)
        print(f"{count} spheres, {t_end:g} s: {seconds / t_end * 4.0:.0f} ms a step on average; "
              f"{result.notes[-1]}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
