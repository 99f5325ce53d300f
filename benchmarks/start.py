"""What a user waits for: the first run on a machine, the next ones, and one after an edit.

Wall and CPU seconds of whole processes, their children included: optimisation in the background
goes on after a first run has ended. The cases are run in turn, so that the load of the machine is
that of all. One is the first run from a wheel with ready-made objects, as it is published.
"""

import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from support.outside import Outside, build
from support.process import REPOSITORY, environment

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.runtime import ready

#: The model, and how often each case is run.
MODEL, REPEATS = "fourbar3", 5
FORCE = """
from dap3d_core.interface import Body, Force, body, hookimpl
interface_version = 1
class Push(Force):
    keyword = "push"
    body_i: Body = body()
    def wrench(mass_i, r_i):
        return ((mass_i * {strength} * r_i[0], 0.0, 0.0), (0.0, 0.0, 0.0)),
@hookimpl
def dap3d_forces():
    return [Push]
"""
SCENE = """
[scene]
name = "pushed"
schema = 1
[bodies.a]
mass = 1.0
Jp = [1.0, 1.0, 1.0]
r = [1.0, 0.0, 0.0]
[forces.p]
type = "push"
body_i = "a"
[simulation]
t_end = 0.1
dt = 0.05
"""
#: A joint of C alone: J and gamma are derived from it.
JOINT = """
from dap3d_core.interface import Joint, Point, hookimpl, point
from dap3d_core.kernels import dot, sub
interface_version = 1
class Rod(Joint):
    keyword, rows = "rod", 1
    P_i: Point = point()
    P_j: Point = point()
    def C(r_P_i, r_P_j):
        d = sub(r_P_i, r_P_j)
        return ({strength} * (dot(d, d) - 1.0),)
@hookimpl
def dap3d_joints():
    return [Rod]
"""
RODS = """
[scene]
name = "held"
schema = 1
[bodies.a]
mass = 1.0
Jp = [1.0, 1.0, 1.0]
r = [1.0, 0.0, 0.0]
[points.end]
body = "a"
sPp = [0.0, 0.0, 0.0]
[points.base]
body = "ground"
sPp = [0.0, 0.0, 0.0]
[joints.rod]
type = "rod"
P_i = "end"
P_j = "base"
[simulation]
t_end = 0.1
dt = 0.05
"""
#: What is edited: the plugin, its scene.
EDITED = {"pushed": (FORCE, SCENE), "held": (JOINT, RODS)}
#: Runs a four-bar until programs of it run; kernels are in the cache folder, programs are not.
CHANGE_OVER = """
import sys
import time
from functools import partial
sys.path.insert(0, {here!r})
import programs
import dap3d_core as dap
from dap3d_core.formulations.programs import change_over
evaluator, integration = programs.integration_of(dap.compile({model!r}), 1e6, 1e-9)
change, begun = change_over.ChangeOver(evaluator), time.perf_counter()
while not any(record.programs for record in change_over._records.values()):
    change.during(integration, partial(integration.advance, 2000))
print(time.perf_counter() - begun)
"""


def change_over(folder, env):
    """Wall seconds from the first step of a run to programs of its scene."""
    for program in Path(env["DAP3D_CACHE_DIR"]).glob("program-*"):
        program.unlink()
    script = CHANGE_OVER.format(here=str(Path(__file__).parent), model=MODEL)
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=True, capture_output=True, env=env, cwd=folder)
    return float(done.stdout)


def seconds(command, env, folder):
    """Wall and CPU seconds of a process."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=env, cwd=folder)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def let_end(cache, is_dropped):
    """Wait for optimisation in the background; in a cache that is dropped, of one unit alone."""
    waiting = sorted(cache.glob("*.ll"), key=_requested)
    for path in waiting[1:] if is_dropped else ():
        path.unlink(missing_ok=True)  # what it comes to last is not there: it ends
    while list(cache.glob("*.ll")):
        time.sleep(0.05)


def _requested(path):
    """When a file was written, ns; 0 where its turn is over."""
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def measure():
    """Rows of the table: first runs, runs that find all in the cache, a run after an edit."""
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root)
        sources = sys.executable
        for name, (_, scene) in EDITED.items():
            (folder / name).mkdir()
            (folder / name / "scene.toml").write_text(scene)
        cases = {
            "first run": (sources, MODEL),
            "first run from a wheel": (_python_with_wheel(folder / "wheel"), MODEL),
            "warm run": (sources, MODEL),
            "first run, radau": (sources, MODEL, "--integrator", "radau"),
            "edit to result": (sources, str(folder / "pushed"), "--allow-code"),
            "edit to result, J and gamma derived": (sources, str(folder / "held"), "--allow-code"),
        }
        times, changes = {case: [] for case in cases}, []
        for strength in range(REPEATS + 1):
            for name, (plugin, _) in EDITED.items():
                (folder / name / "plugin.py").write_text(plugin.format(strength=-1.0 - strength))
            for case, (python, *arguments) in cases.items():
                cache = folder / case
                if case.startswith("first run"):
                    shutil.rmtree(cache, ignore_errors=True)
                command = [python, "-m", "dap3d_core.cli", "run", *arguments]
                env = environment(cache)
                times[case].append(seconds([*command, "-o", "run.nc", "--force"], env, folder))
                let_end(cache, is_dropped=case.startswith("first run"))
            changes.append((change_over(folder, environment(folder / "warm run")),) * 2)
        times["change-over to programs"] = changes
        # the first round fills caches, and compiles bytecode
        return [row(case, runs[1:]) for case, runs in times.items()]


def row(case, times):
    """A row of the table from (wall, CPU) of some runs."""
    wall, cpu = (statistics.median(column) for column in zip(*times, strict=True))
    return {"case": case, "wall_s": wall, "cpu_s": cpu, "runs": len(times)}


def _python_with_wheel(folder):
    """Python of an environment with the wheel of this tree and this machine's objects."""
    folder.mkdir()
    there = Outside(folder)
    target = ready.target_of(objects.processor().triple, objects.host_features())
    build(REPOSITORY, there.wheels, DAP3D_READY_OBJECTS=target or "")
    there.install(*there.wheels.iterdir())
    return there.python
