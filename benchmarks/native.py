"""Exported models in C: real time at 1 kHz, steps over those of Python, sizes, first exports.

``python benchmarks/native.py real_time | steps | sizes ...``: those alone.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import chain
from pathlib import Path

import dap3d_core as dap
from dap3d_core.native.build import own_platform

#: Runs of 60 s at 1 kHz, and passes of each.
SECONDS, RATE, PASSES = 60, 1000, 3
#: A road that shakes a quarter car until its wheel lifts off; its tyre as a spring that pushes and
#: does not pull, or a rigid wheel that steps of contacts follow.
SHAKEN = {"type": "harmonic", "amplitude": 0.02, "frequency": 37.7}
SPRING = {"P_i": "upright.O", "P_j": "road.O", "a_j": "road.z", "radius": "= tyre + bend",
          "k": 200e3, "zeta": 0.05, "rebound": False}  # fmt: skip


def shaken(*, is_rigid):
    """A quarter car whose wheel lifts off."""
    scene = dap.load("quarter_car").copy()
    del scene.functions["profile"], scene.forces["tyre"]
    profile = dict(SHAKEN)
    scene.add_function(profile.pop("type"), "profile", **profile)
    if not is_rigid:
        scene.add_force("plane_stop", "tyre", **SPRING)
        return scene
    for name in ("wheel", "plate"):
        shape = scene.shapes.pop(name)
        fields = shape.fields | ({"radius": 0.29} if name == "wheel" else {})
        scene.add_shape(shape.type, name, collides=True, **fields)
    scene.add_material("rubber", mu=0.8)
    scene.add_collisions(material="rubber")
    return scene


def exported(folder, model, **options):
    """A model in C, and the seconds that its export took."""
    start = time.perf_counter()
    made = dap.export_model(model, folder / "model", format="c", force=True, **options)
    return made, time.perf_counter() - start


def real_time():
    """Microseconds of steps of quarter cars at 1 kHz: of the wall, of the CPU, and their own.

    The last is the least of the passes, which leaves out what else the machine does.
    """
    fixed = {"integrator": "rk4", "step": 1.0 / RATE}
    stepped = {"contact": "stepping", "contact_step": 1.0 / RATE}
    cases = {
        "as shipped, rk4": ("quarter_car", fixed),
        "lifts off, rk4": (shaken(is_rigid=False), fixed),
        "rigid wheel, stepping": (shaken(is_rigid=True), stepped),
    }
    for name, (model, options) in cases.items():
        with tempfile.TemporaryDirectory() as scratch:
            made, _ = exported(Path(scratch), model, t_end=SECONDS, **options)
            [archive] = (made.path / own_platform()).glob("*.a")
            program, source = Path(scratch) / "real", Path(__file__).parent / "real_time.c"
            subprocess.run(["cc", "-O2", "-DDAP3D_STATIC", f"-I{made.path}", source, archive, "-lm",
                            "-o", program], check=True)  # fmt: skip
            given = map(str, (SECONDS, RATE, PASSES))
            done = subprocess.run([program, *given], check=True, capture_output=True, text=True)
        for line in done.stdout.splitlines():
            clock, *times = line.split()
            parts = zip(("median", "99.99 %", "worst"), map(float, times), strict=True)
            yield {"model": name, "us of": clock, **dict(parts)}


def _median(step, count):
    """Microseconds of a step."""
    took = []
    for k in range(count):
        start = time.perf_counter()
        step(k)
        took.append(time.perf_counter() - start)
    return 1e6 * statistics.median(took)


def steps(models=("pen1", "crane", "fourbar3", "quarter_car"), count=500, dt=1e-3):
    """Microseconds of a step to the next millisecond, here and in Python; size, time of export."""
    found = []
    for name in models:
        with tempfile.TemporaryDirectory() as scratch:
            exported(Path(scratch), name)  # code is in the cache then
            made, seconds = exported(Path(scratch), name)
            run = dap.load_native(made.path).start(10.0)
            here = dap.start(name, t_end=10.0, record=False)
            times = {"C": _median(lambda k, run=run: run.step_to(dt * (k + 1)), count),
                     "Python": _median(lambda _, run=here: run.step(dt), count)}  # fmt: skip
            found.append({"model": name, **times, "kB": made.size / 1e3, "export_s": seconds})
    return found


#: Exports a model by a process of its own: the seconds that it takes, and bytes of the library.
FIRST = """
import sys, time
import dap3d_core as dap
start = time.perf_counter()
made = dap.export_model(sys.argv[1], sys.argv[2], format="c")
print(time.perf_counter() - start, made.size)
"""


def sizes(models=("gripper", "hand", "humanoid", "walker", "pen1", "fourbar3")):
    """kB of shared libraries; seconds of an export with an empty cache, and with a full one."""
    for name in models:
        with tempfile.TemporaryDirectory() as scratch:
            env = os.environ | {"DAP3D_CACHE_DIR": f"{scratch}/cache"}
            lines = []
            for k in range(2):
                command = [sys.executable, "-c", FIRST, name, f"{scratch}/{k}"]
                lines.append(subprocess.check_output(command, env=env, text=True).split())
        (first, size), (again, _) = lines
        yield {
            "model": name,
            "kB": int(size) / 1e3,
            "first_s": float(first),
            "again_s": float(again),
        }


if __name__ == "__main__":
    parts = {"real_time": real_time, "steps": steps, "sizes": sizes}
    for row in chain(*(parts[name]() for name in sys.argv[1:] or parts)):
        print(row, flush=True)
