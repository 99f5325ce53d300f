"""Proof from outside: wheels in a fresh environment, with good and with broken packages.
dap3d and every plugin are truly installed from wheels. Nothing of the working tree can be
reached."""

import shlex
import shutil
import time
import zipfile
from math import exp, sin

import pytest
from support.internals import objects, ready
from support.outside import Outside, build, isolated, pip
from support.pages import steps, write
from support.process import REPOSITORY, run

pytestmark = pytest.mark.slow
TARGET = ready.target_of(objects.processor().triple, objects.host_features())


def environment_of_a_user(folder):
    """An environment with dap3d and dap3d-example from their wheels, and a plugin of a user.
    The wheel of dap3d has ready-made objects for this machine, where there are such."""
    there = Outside(folder)
    ready_made = {"DAP3D_READY_OBJECTS": TARGET, "DAP3D_READY_LEVEL": "0"} if TARGET else {}
    build(REPOSITORY, there.wheels, **ready_made)
    build(REPOSITORY / "plugins" / "dap3d-example", there.wheels)
    there.install(*there.wheels.iterdir())
    # a user writes one more
    there.dap3d("new-plugin", "cord", "--kind", "force")
    build(there.folder / "dap3d-cord", there.wheels)
    there.install(*there.wheels.glob("dap3d_cord-*"))
    return there


def the_wheels_hold_what_they_should_and_no_more(outside):
    names = {}
    for wheel in outside.wheels.iterdir():
        with zipfile.ZipFile(wheel) as archive:
            names[wheel.name.partition("-")[0]] = {n.partition("/")[0] for n in archive.namelist()}
            if wheel.name.startswith("dap3d-"):
                assert "dap3d_core/cli/templates/joint/type.txt" in archive.namelist()
    own = {
        "dap3d_core",
        "dap3d_joints",
        "dap3d_forces",
        "dap3d_functions",
        "dap3d_formats",
        "dap3d_matlab",
        "dap3d_results",
        "dap3d_contacts",
    }
    assert {n for n in names["dap3d"] if "dist-info" not in n} == own
    assert {n for n in names["dap3d_example"] if "dist-info" not in n} == {"dap3d_example"}


def nothing_of_the_working_tree_is_reached(outside):
    script = "import dap3d_core, dap3d_joints, dap3d_example, sys; print(dap3d_core.__file__)"
    script += "; print(dap3d_joints.__file__); print(dap3d_example.__file__); print(sys.path)"
    said = outside.run(outside.python, "-c", script).stdout
    assert str(REPOSITORY) not in said
    assert said.count(str(outside.folder.parent)) >= 3


RUNS = """
import hashlib
import dap3d_core as dap
from dap3d_core.kernels.compiler import units
digest = hashlib.sha256()
for model in ("fourbar3", "pen2", "bodies2"):
    for integrator in ("dop853", "adams", "radau"):
        result = dap.simulate(dap.load(model), t_end=0.02, dt=0.01, integrator=integrator)
        digest.update(result.u.tobytes())
print(len(units.compiled_units), digest.hexdigest())
"""


def first_runs_with_ready_made_objects_compile_nothing(outside):
    """And have the bits of runs of the sources, compiled for this very processor."""
    if TARGET is None:
        return  # objects are made for no such machine
    count, digest = outside.run(outside.python, "-c", RUNS).stdout.split()
    assert count == "0"
    assert digest == run(RUNS).split()[1]


#: Without ready-made objects.
OWN = {"DAP3D_CPU": "x86-64-v2"} if objects.processor().triple.startswith("x86_64") else {}
#: Runs the pendulum and prints its last state, and how many functions were compiled on the way.
PENDULUM = """
import dap3d_core as dap
from dap3d_core.kernels.compiler.units import compiled_units
result = dap.simulate(dap.load("pen1"), t_end=0.1, dt=0.1)
print(" ".join(x.hex() for x in result.u[-1].tolist()), len(compiled_units))
"""


def the_first_run_compiles_for_all_that_follow(outside):
    """It says so, once. Another process, a script too, finds every function in the cache, and has
    the same bits. Nothing was compiled that formulations with dependent rows need."""
    command = ("run", "pen1", "--t-end", "0.1", "--dt", "0.1", "-o", "pen1.nc", "--force")
    first = outside.dap3d(*command, **OWN).stderr
    assert first.count("compiling for the first time; this happens once") == 1
    assert "sph" in first
    while list(outside.cache.glob("*.ll")):  # the process beside is at work
        time.sleep(0.1)
    assert outside.dap3d(*command, **OWN).stderr == ""
    script = "import dap3d_core as dap; u = dap.open('pen1.nc').u[-1]"
    script += "; print(' '.join(x.hex() for x in u.tolist()))"
    state = outside.run(outside.python, "-c", script).stdout.split()
    *found, compiled = outside.run(outside.python, "-c", PENDULUM, **OWN).stdout.split()
    assert compiled == "0"
    assert found == state
    made = {path.name.partition("-")[0] for path in outside.cache.glob("*.o")}
    assert {"standard.rhs", "step.advance"} <= made
    assert not any(name.startswith(("lsq.", "penalty.", "adams.", "radau")) for name in made)


def a_plugin_that_was_written_there_is_checked_and_its_scene_runs(outside):
    package = outside.folder / "dap3d-cord"
    said = outside.dap3d("check-plugin", "cord", "position-servo").stdout
    assert "2 types checked: nothing is wrong" in said
    outside.dap3d("run", "scene.toml", "-o", "cord.nc", cwd=package)
    script = "import dap3d_core as dap; r = dap.open('cord.nc'); print(r.r[-1, 0, 2])"
    z = float(outside.run(outside.python, "-c", script, cwd=package).stdout)
    # m z'' + c z' + k z = 0 about the place of rest, after 2 s; rtol of a run is 1e-8
    decay, t = 4.0 / (2.0 * 2.0), 2.0
    omega = (200.0 / 2.0 - decay**2) ** 0.5
    assert z == pytest.approx(-1.0981 + 0.5 / omega * exp(-decay * t) * sin(omega * t), abs=1e-5)


FORCE = """
from dap3d_core.interface import Body, Force, body, hookimpl, number
import {imported}

interface_version = {version}


class Push(Force):
    \"\"\"A constant push along x.\"\"\"

    keyword = "{keyword}"
    body_i: Body = body()
    k: float = number(default=1.0)

    def wrench(k):
        f = {formula}
        return (((f, 0.0, 0.0), (0.0, 0.0, 0.0)),)


@hookimpl
def {hook}():
    return [Push]
"""

#: What is broken -> what stands in the module, and what ``dap3d plugins`` says of it.
BROKEN = {
    "import-error": ({"imported": "no_such_package"}, "broken", "No module named 'no_such"),
    "wrong-hook": ({"hook": "dap3d_force"}, "broken", "there is no hook dap3d_force"),
    "weight": ({}, "duplicate", "distribution dap3d 0.2.0"),
    "old-version": ({"version": "0"}, "broken", "written for interface version 0"),
    "not-compiled": ({"formula": "float('{}'.format(k))"}, "broken", "cannot be compiled"),
}


def wheel_of(folder, keyword, changes):
    """A wheel with one module that brings a force."""
    values = {"imported": "math", "version": "1", "formula": "k", "hook": "dap3d_forces"}
    module = f"broken_{keyword}".replace("-", "_")
    info = f"{module}-1.0.dist-info"
    members = {
        f"{module}.py": FORCE.format(keyword=keyword, **(values | changes)),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: broken-{keyword}\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": f"[dap3d.forces]\n{keyword} = {module}\n",
    }
    members[f"{info}/RECORD"] = "".join(f"{m},,\n" for m in (*members, f"{info}/RECORD"))
    path = folder / f"{module}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return path


SCENE = """
[bodies.stone]
mass = 1.0
Jp = [1.0, 1.0, 1.0]

[forces.push]
type = "{}"
body_i = "stone"

[simulation]
t_end = 0.1
dt = 0.1
"""


def broken_packages_break_nothing_else_and_are_explained(outside, folder):
    before = outside.plugins()
    assert {t["state"] for t in before.values()} == {"ok"}
    outside.install(*(wheel_of(folder, keyword, c) for keyword, (c, _, _) in BROKEN.items()))
    after = outside.plugins()
    for keyword, (_, state, reason) in BROKEN.items():
        found = after[keyword, f"broken-{keyword}"]
        assert found["state"] == state
        assert reason in found["reason"]
        assert f"broken-{keyword}" in found["reason"]
        assert "\n" not in found["reason"]
    for key in before:
        assert after[key]["state"] == ("duplicate" if key[0] == "weight" else "ok")
    assert "not usable" in outside.dap3d("plugins").stdout

    outside.dap3d("check-plugin", "cord", "-q")
    package = shutil.copytree(outside.folder / "dap3d-cord", folder / "cord")
    scene = (package / "scene.toml").read_text()
    said = outside.dap3d("run", "scene.toml", code=2, cwd=package).stderr
    assert "DAP3D_BLOCK=broken-weight" in said, "two packages bring weight; says what to do"
    (package / "scene.toml").write_text(
        scene.replace('type = "weight"', 'type = "f"').replace(
            "gravity = 9.81\nwgt = [0.0, 0.0, -1.0]", 'body_i = "weight"\nf = [0.0, 0.0, -19.62]'
        )
    )
    outside.dap3d("run", "scene.toml", cwd=package)


def a_kernel_that_cannot_be_compiled_ends_a_run_with_one_message(outside, folder):
    (folder / "scene.toml").write_text(SCENE.format("not-compiled"))
    said = outside.dap3d("run", "scene.toml", code=2, cwd=folder).stderr
    assert "its kernels cannot be compiled (not-compiled: wrench)" in said
    assert "broken_not_compiled.py:" in said, "the line"


def the_tutorial_can_be_followed(outside):
    """Every file, script and command of it, in its order; scripts go on where the last one ended.
    Its pip takes what is needed to build a package from here."""
    folder = outside.folder / "tutorial"
    folder.mkdir()
    page = (REPOSITORY / "docs" / "tutorials" / "your-own-joint.md").read_text()
    script, commands = "", []
    for step in steps(page, ("dap3d", "cp", "rm", "pip", "pytest")):
        if step.kind == "file":
            write(step.text, folder)
        elif step.kind == "python":
            script += step.text
            outside.run(outside.python, "-c", script, cwd=folder)
        else:
            program, *words = shlex.split(step.text)
            commands.append(program)
            if program == "pip":
                assert words[0] == "install"
                pip("--python", outside.python, "install", *isolated(), *words[1:], cwd=folder)
            elif program == "pytest":
                outside.run(outside.python, "-m", "pytest", *words, cwd=folder)
            else:
                outside.run(outside.bin / "dap3d" if program == "dap3d" else program, *words,
                            cwd=folder)  # fmt: skip
    assert set(commands) == {"dap3d", "cp", "rm", "pip", "pytest"}
    assert outside.plugins()["rope", "dap3d-rope"]["state"] == "ok"


def test_from_outside(tmp_path):
    """All of the above, in one environment: what is compiled there takes most of the time."""
    outside, folder = environment_of_a_user(tmp_path), tmp_path / "more"
    folder.mkdir()
    the_wheels_hold_what_they_should_and_no_more(outside)
    nothing_of_the_working_tree_is_reached(outside)
    first_runs_with_ready_made_objects_compile_nothing(outside)
    the_first_run_compiles_for_all_that_follow(outside)
    a_plugin_that_was_written_there_is_checked_and_its_scene_runs(outside)
    the_tutorial_can_be_followed(outside)
    broken_packages_break_nothing_else_and_are_explained(outside, folder)
    a_kernel_that_cannot_be_compiled_ends_a_run_with_one_message(outside, folder)
