"""Types that are written or packaged wrongly: each is refused by name, and spoils nothing else.
What a package may do wrong is in tests/unit/registry; here are a model's own files, what kernels do
wrong, and what a file may do to the process that loads it."""

import json
import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from support.own_types import registry_of
from support.plain import jit_is_on
from tests.e2e.conftest import COMMAND, environment

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.interface import Joint, PluginError, Point, point
from dap3d_core.kernels import row, sub

HEAD = """
import os, random, sys, time
from dap3d_core.interface import Body, Force, body, hookimpl
from dap3d_core.kernels import sqrt

interface_version = 1
"""
TYPE = """
class Mine(Force):
    keyword = "mine"
    body_i: Body = body()

    def wrench(t, r_i):
        {}


@hookimpl
def dap3d_forces():
    return [Mine]
"""
GOOD = "return (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)"
SCENE = """
[bodies.b]
mass = 1.0
Jp = [1.0, 1.0, 1.0]

[forces.F]
type = "mine"
body_i = "b"

[simulation]
t_end = 0.5
dt = 0.1
"""


@pytest.fixture
def model(tmp_path):
    """Writes a model folder with a type of its own; lines at import, lines of its kernel."""

    def write(kernel=GOOD, at_import=""):
        (tmp_path / "scene.toml").write_text(SCENE)
        lines = textwrap.indent(textwrap.dedent(kernel), " " * 8).strip()
        text = HEAD + textwrap.dedent(at_import) + TYPE.format(lines)
        (tmp_path / "plugin.py").write_text(text)
        return tmp_path

    return write


def compiled(folder):
    return dap.compile(folder, allow_code=True)


# ------------------------------------------------------------------ kernels

KERNELS = {
    "raises later": (f"if t > 0.3:\n    raise ValueError('no')\n{GOOD}", "ValueError: no"),
    "returns nothing later": (f"if t > -5.0:\n    return None\n{GOOD}", r"it returned shape \(\)"),
    "writes to its input": (f"r_i[0] = 5.0\n{GOOD}", "does not support item assignment"),
    "exits": ("sys.exit(3)", "SystemExit: 3"),
    "calls itself": ("return Mine.wrench(t, r_i)", "RecursionError"),
}
#: The compiler's reason is told; there is no quiet way round it.
NOT_COMPILED = {
    "imports": f"import time\n{GOOD}",
    "prints": f"print(t)\n{GOOD}",
    "formats": "return (0.0, 0.0, float('{:f}'.format(t))), (0.0, 0.0, 0.0)",
}


@pytest.mark.parametrize(("kernel", "words"), KERNELS.values(), ids=KERNELS)
def test_a_kernel_that_is_none_is_refused_with_file_and_function(model, kernel, words):
    folder = model(kernel)
    with pytest.raises(dap.SceneError, match=words) as caught:
        compiled(folder)
    said = str(caught.value)
    assert str(folder / "plugin.py") in said
    assert [m.key for m in caught.value.mistakes] == ["forces.F.type"]


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
@pytest.mark.parametrize("kernel", NOT_COMPILED.values(), ids=NOT_COMPILED)
def test_what_cannot_be_compiled_is_refused_with_its_reason(model, kernel):
    folder = model(kernel)
    with pytest.raises(PluginError, match=r"its kernels cannot be compiled \(mine: wrench\)") as e:
        compiled(folder)
    assert str(folder / "plugin.py") in str(e.value)
    assert "A kernel is plain" in str(e.value)
    assert "\n" not in str(e.value)


# ------------------------------------------------------------------ joints with wrong formulas


class Plane(Joint):
    """P_i stays in the plane z = 0 of ground, formulas right."""

    keyword = "plane"
    rows = 1
    P_i: Point = point()
    P_j: Point = point()

    def C(r_P_i, r_P_j):
        return (sub(r_P_i, r_P_j)[2],)

    def J(s_P_i, s_P_j):
        x, y, _ = s_P_i
        xj, yj, _ = s_P_j
        return row((0.0, 0.0, 1.0), (y, -x, 0.0)), row((0.0, 0.0, -1.0), (-yj, xj, 0.0))

    def gamma(w_i, s_P_i_dot, w_j, s_P_j_dot):
        a = w_i[0] * s_P_i_dot[1] - w_i[1] * s_P_i_dot[0]
        return (w_j[0] * s_P_j_dot[1] - w_j[1] * s_P_j_dot[0] - a,)


class Squared(Plane):
    """The same plane as z^2 = 0: the gradient is zero wherever it holds."""

    keyword = "squared"

    def C(r_P_i, r_P_j):
        z = sub(r_P_i, r_P_j)[2]
        return (z * z,)

    def J(r_P_i, r_P_j, s_P_i, s_P_j):
        z = 2.0 * sub(r_P_i, r_P_j)[2]
        x, y, _ = s_P_i
        xj, yj, _ = s_P_j
        return row((0.0, 0.0, z), (z * y, -z * x, 0.0)), row((0.0, 0.0, -z), (-z * yj, z * xj, 0.0))

    def gamma(r_P_i, r_P_j, v_P_i, v_P_j, w_i, s_P_i_dot, w_j, s_P_j_dot):
        z, z_dot = sub(r_P_i, r_P_j)[2], sub(v_P_i, v_P_j)[2]
        a = w_i[0] * s_P_i_dot[1] - w_i[1] * s_P_i_dot[0]
        b = w_j[0] * s_P_j_dot[1] - w_j[1] * s_P_j_dot[0]
        return (-2.0 * z_dot * z_dot + 2.0 * z * (b - a),)


def _on_a_plane(type_, method=None):
    scene = dap.Scene(name="plane")
    scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("weight")
    scene.add_joint(type_.keyword, "floor", P_i="b.O", P_j="ground.O")
    return dap.compile(scene, method=method, registry=registry_of(type_))


@pytest.mark.slow
def test_a_row_whose_gradient_is_zero_at_the_start_is_named():
    """Nothing holds the body: a run would let it fall through the plane. No method runs it."""
    good = dap.simulate(_on_a_plane(Plane), t_end=0.2)
    assert np.all(np.abs(good.r[:, 0, 2]) < 1e-12)
    found = _on_a_plane(Squared)
    assert found.redundancy().rank.rank == 0
    with pytest.raises(dap.RedundantError, match="floor"):
        dap.simulate(_on_a_plane(Squared, "standard"), t_end=0.2)
    with pytest.raises(dap.SimulationError, match="gradient of a row of joint floor is zero"):
        dap.simulate(found, t_end=0.2)


# ------------------------------------------------------------------ what a file does to the process


def test_what_a_models_file_changes_is_put_back_or_told(model):
    folder = model(
        at_import="""
        import signal
        os.chdir("/")
        sys.path.insert(0, "/nowhere")
        sys.stdout = None
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print("said at import")
    """
    )
    before = os.getcwd(), sys.stdout, signal.getsignal(signal.SIGINT)
    try:
        notes = "\n".join(compiled(folder).notes)
    finally:
        while "/nowhere" in sys.path:
            sys.path.remove("/nowhere")
    assert (os.getcwd(), sys.stdout, signal.getsignal(signal.SIGINT)) == before
    for words in ("changed the working folder", "changed sys.path", "changed what Ctrl-C does"):
        assert words in notes


def test_ctrl_c_while_a_models_file_is_loaded_names_it(model, capsys):
    """A file that never ends loading is then known."""
    folder = model(at_import="raise KeyboardInterrupt")
    assert main(["run", str(folder), "--allow-code"]) == 130
    said = "".join(capsys.readouterr().err.split())  # a long path is broken over lines
    words = f"interrupted while {folder / 'plugin.py'} was loaded"
    assert "".join(words.split()) in said


#: Ways to write to stdout that no redirection inside Python sees.
SPOILING = {
    "descriptor": "os.write(1, b'raw words')",
    "at exit": "import atexit; atexit.register(print, 'words')",
    "fork": "os.fork()",
}


@pytest.mark.slow
@pytest.mark.parametrize("line", SPOILING.values(), ids=SPOILING)
def test_json_is_alone_on_stdout_whatever_a_file_writes(model, line):
    """One object, and one file: a copy of the process does not go on with the run."""
    folder = model(at_import=line)
    done = _run(folder)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"] == "done"
    assert ("words" in done.stderr) == ("words" in line)
    assert ("the copy ends" in done.stderr) == ("fork" in line)
    assert not list(folder.glob("*.part*"))


def _run(folder, **variables):
    command = [*COMMAND, "run", ".", "--allow-code", "--json", "-o", "out.nc"]
    return subprocess.run(
        command,
        cwd=folder,
        env=environment(**variables),
        capture_output=True,
        text=True,
        timeout=300,
    )


#: Classes of a model's own file that have the keyword of an installed force.
SHADOWS = {"plain": "keyword = 'fp'", "found by running it": "keyword = ''.join(('f', 'p'))"}


@pytest.mark.parametrize("keyword", SHADOWS.values(), ids=SHADOWS)
@pytest.mark.parametrize("table", ["[forces.A]", "[forces.Z]"], ids=["before", "after"])
def test_a_models_file_does_not_shadow_a_standard_type_quietly(model, table, keyword):
    """Refused, in whichever order the scene names its types."""
    folder = model(at_import=SHADOWING.format(keyword))
    text = (folder / "plugin.py").read_text().replace("[Mine]", "[Mine, Fp]")
    (folder / "plugin.py").write_text(text)
    scene = (folder / "scene.toml").read_text()
    fp = f'{table}\ntype = "fp"\nbody_i = "b"\nfp = [1.0, 0.0, 0.0]\n\n'
    order = fp + "[forces.F]" if "A" in table else "[forces.F]"
    scene = scene.replace("[forces.F]", order)
    (folder / "scene.toml").write_text(scene if "A" in table else scene + "\n" + fp)
    with pytest.raises(dap.SceneError, match="'fp' is brought by distribution dap3d") as caught:
        compiled(folder)
    assert f"and {folder / 'plugin.py'}; rename the one in the model's own file" in str(
        caught.value
    )


SHADOWING = """
class Fp(Force):
    {}
    body_i: Body = body()

    def wrench(t):
        return (t, 0.0, 0.0), (0.0, 0.0, 0.0)
"""


def test_a_models_file_that_is_not_needed_is_not_run_and_does_not_shadow_quietly(model):
    """Its text tells, where it may be run; a class of another kind shadows nothing."""
    folder = model(at_import=SHADOWING.format("keyword = 'weight'") + "\nraise RuntimeError('ran')")
    scene = SCENE.replace('type = "mine"\nbody_i = "b"', 'type = "weight"')
    (folder / "scene.toml").write_text(scene)
    with pytest.raises(dap.SceneError, match="'weight' is brought by distribution dap3d"):
        compiled(folder)
    assert any("was not loaded" in note for note in dap.compile(folder).notes), "not even read"
    text = (folder / "plugin.py").read_text().replace("Fp(Force)", "Fp(Function)")
    (folder / "plugin.py").write_text(text)
    notes = compiled(folder).notes
    assert any(str(folder / "plugin.py") in note and "was not loaded" in note for note in notes)
