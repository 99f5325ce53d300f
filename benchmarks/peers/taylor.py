"""One body beside heyoka, which integrates equations written by hand by their Taylor series.

``build/peers-venv/bin/python benchmarks/peers/taylor.py``, after ``make bench-peers`` has made it.

heyoka gets the least equations there are: quaternion and omega' of a body about a fixed point, the
angle of a rod. Euler's equations are its input, and it compiles Taylor series of these very
equations. dap3d gets the scene, and runs by its programs. Ratios of CPU times of the thread to
reach an error at the end, the least of several rounds in turn; errors against references.json.
"""

import math
import time

import dap3d_peer
import levels
import mechanisms
import numpy as np
import references

from dap3d_core.kernels.compiler.background import optimiser

SCENES = ("free-body-1", "heavy-top-1", "revolute-chain-1")
ROUNDS, RUNS = 7, 20
TOLERANCES = [10.0**-k for k in range(2, 15)]


def turning_equations(mechanism):
    """Equations of a body about a fixed point, their start, and what gives its pose."""
    import heyoka as hy

    body, arm = mechanism.bodies[0], mechanism.bodies[0].x
    J = body.J + body.mass * (arm @ arm - arm**2)
    a, b, c, d, x, y, z = hy.make_vars("a", "b", "c", "d", "x", "y", "z")
    down = (2 * (b * d - a * c), 2 * (c * d + a * b), 1.0 - 2 * (b * b + c * c))
    f = [-body.mass * mechanism.gravity * e for e in down] if mechanism.gravity else [0.0] * 3
    moment = [arm[i - 2] * f[i - 1] - arm[i - 1] * f[i - 2] for i in range(3)]
    equations = [
        (a, -0.5 * (b * x + c * y + d * z)),
        (b, 0.5 * (a * x + c * z - d * y)),
        (c, 0.5 * (a * y + d * x - b * z)),
        (d, 0.5 * (a * z + b * y - c * x)),
        (x, (moment[0] - (J[2] - J[1]) * y * z) / J[0]),
        (y, (moment[1] - (J[0] - J[2]) * z * x) / J[1]),
        (z, (moment[2] - (J[1] - J[0]) * x * y) / J[2]),
    ]

    def pose(state):
        A = mechanisms.rotation_of(state[:4])
        return (A @ arm)[None], A[None]

    return equations, [1.0, 0.0, 0.0, 0.0, *body.w], pose


def rod_equations(mechanism):
    """Equation of the angle of a rod about y, its start, and what gives its pose."""
    import heyoka as hy

    body = mechanism.bodies[0]
    arm = body.x[0]
    J = body.J[1] + body.mass * arm**2
    q, rate = hy.make_vars("q", "rate")
    equations = [(q, rate), (rate, body.mass * mechanism.gravity * arm / J * hy.cos(q))]

    def pose(state):
        A = mechanisms.about_y(state[0])
        return (A @ body.x)[None], A[None]

    return equations, [0.0, 0.0], pose


def heyoka_trials(mechanism):
    """What starts a trial, by a tolerance."""
    import heyoka as hy

    made = rod_equations if mechanism.name == "revolute-chain" else turning_equations
    equations, y0, pose = made(mechanism)
    y0 = np.array(y0)

    def start(tolerance):
        integrator = hy.taylor_adaptive(equations, y0.tolist(), tol=tolerance)

        def run():
            before = time.thread_time()
            integrator.time = 0.0
            integrator.state[:] = y0
            integrator.propagate_until(mechanism.t_end)
            return time.thread_time() - before, 0

        return run, lambda: pose(integrator.state)

    return start


def trials_of(mechanism):
    """(program, method, parameter, run, end) of all settings."""
    scene = dap3d_peer.scene_of(mechanism)
    start = heyoka_trials(mechanism)
    settings = [("heyoka", "taylor", parameter, start) for parameter in TOLERANCES]
    for method in ("unconstrained",) if mechanism.name == "free-body" else ("standard", "joint"):
        model = dap3d_peer.Model(scene, mechanism.t_end, method=method)
        model.take_programs()
        for name in ("dop853", "adams"):
            trial = model.trial(name)
            settings += [("dap3d", f"{method}, {name}", tol, trial) for tol in TOLERANCES]
    return [(*words, *start(words[-1])) for *words, start in settings]


def cells_of(key):
    """Cells as run.py stores them: the least seconds of each setting, and its error."""
    mechanism, reference = mechanisms.mechanism_of(key), references.load()[key]
    for _, _, _, run, _ in trials_of(mechanism):
        run()
    while optimiser.units:  # compiled quickly, not yet well: what is made behind that runs the best
        time.sleep(0.1)
        optimiser.poll(0.0)
    cells = []
    for program, method, parameter, run, end in trials_of(mechanism):
        run()
        error = mechanisms.error_of(mechanism, reference, *end())
        cells.append({"scene": key, "program": program, "method": method, "parameter": parameter,
                      "error": error, "seconds": [math.inf], "run": run})  # fmt: skip
    for _ in range(ROUNDS):
        for cell in cells:
            cell["seconds"] = [min(*cell["seconds"], *(cell["run"]()[0] for _ in range(RUNS)))]
    return cells


def measure():
    """Rows of the table: scene, error, microseconds of both, and the ratio."""
    rows = []
    for key in SCENES:
        cells = cells_of(key)
        for level in levels.LEVELS:
            ours, method = levels.best(cells, key, "dap3d", level)
            theirs, _ = levels.best(cells, key, "heyoka", level)
            rows.append({"scene": key, "level": level, "dap3d_us": 1e6 * ours, "by": method,
                         "heyoka_us": 1e6 * theirs, "ratio": ours / theirs})  # fmt: skip
    return rows


if __name__ == "__main__":
    import run
    from rich.console import Console

    Console(width=120).print(run.shown(measure(), "one body beside heyoka"))
