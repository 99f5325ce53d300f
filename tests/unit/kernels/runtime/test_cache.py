"""Compiled code is kept under a digest of all it was made from: never stale, never made twice.
That a second run of a model compiles nothing: tests/e2e/test_run.py."""

import shutil
import time

import pytest
from support.plain import jit_is_on
from support.process import REPOSITORY, run, start

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled with DAP3D_PLAIN=1")

#: A force type whose kernel calls a helper in another module, and that calls one in a third.
PLUGIN = """
from dap3d_core.interface import Body, Force, body
from helper import push

class Push(Force):
    keyword = "push"
    body_i: Body = body()
    def wrench(mass_i):
        return (push(mass_i), (0.0, 0.0, 0.0))
"""
HELPER = """
from dap3d_core.kernels import scale
import constants
STRENGTH = {strength}
def push(mass):
    return scale(mass * STRENGTH + constants.offset(), (1.0, 0.0, 0.0))
"""
CONSTANTS = """
def offset():
    return {offset}
"""
EVALUATE = """
import sys; sys.path.insert(0, ".")
import numpy as np
from dap3d_core.interface import examine
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, MASS
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_modules import build, compiled_here
from plugin import Push
loop = build(write(examine(Push), "wrench"))
body = np.zeros((2, BODY_WIDTH)); body[1, MASS] = 2.0
arrays = LoopArrays(body=body, F=np.zeros((1, 5)), idx=np.ones(1, dtype=np.int64),
                    par=np.zeros(1))
force = np.zeros(12)
call_loop(loop_list([loop]), 0, 0.0, arrays, np.array([0, 0, 1]), force, force, force)
print(force[6], len(compiled_here))
"""


def write_plugin(folder, strength=3.0, offset=0.5):
    (folder / "plugin.py").write_text(PLUGIN)
    (folder / "helper.py").write_text(HELPER.format(strength=strength))
    (folder / "constants.py").write_text(CONSTANTS.format(offset=offset))


@pytest.mark.slow
def test_an_edited_helper_gives_the_new_number(tmp_path):
    """A change in a helper of the kernel's helper is seen, and only then compiled anew."""
    cache = tmp_path / "cache"
    write_plugin(tmp_path)

    def said():  # bytecode of a file of the same size and second would be taken for the new one's
        return run(EVALUATE, cache, cwd=tmp_path, PYTHONDONTWRITEBYTECODE=1)

    assert said() == "6.5 1"
    assert said() == "6.5 0"
    write_plugin(tmp_path, strength=4.0)
    assert said() == "8.5 1"
    write_plugin(tmp_path, strength=4.0, offset=1.0)
    assert said() == "9.0 1"
    write_plugin(tmp_path)
    assert said() == "6.5 0"


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_does_no_harm(tmp_path):
    """Without a folder to write to the code is compiled for this process alone."""
    write_plugin(tmp_path)
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert (
        run(EVALUATE, blocked / "cache", cwd=tmp_path, XDG_CACHE_HOME=blocked).split()[0] == "6.5"
    )


OWN_TYPE = """
import sys
import dap3d_core as dap
result = dap.simulate(dap.load(sys.argv[1]), t_end=0.1, dt=0.1, allow_code=True)
print(result.r[-1, 0, 2])
"""


@pytest.mark.slow
def test_a_model_with_its_own_types_can_be_copied(tmp_path):
    """The same plugin.py in another folder is another module, with compiled code of its own."""
    assert run_copy(tmp_path / "first") == run_copy(tmp_path / "second")


def run_copy(folder):
    """Copy ball1 to a folder and run it there."""
    shutil.copytree(REPOSITORY / "models" / "ball1", folder)
    return run(OWN_TYPE.replace("sys.argv[1]", repr(str(folder))))


@pytest.mark.slow
def test_damaged_code_is_made_anew_and_a_warning_says_so(tmp_path):
    """One bit can crash the process or change a number: no damaged file is loaded or executed."""
    cache = tmp_path / "cache"
    write_plugin(tmp_path)
    run(EVALUATE, cache, cwd=tmp_path)
    while list(cache.glob("*.ll")):  # the process beside is at work
        time.sleep(0.1)
    files = list(cache.glob("*.o"))
    assert {f.name.partition("-")[0] for f in files} == {"loop", "function_lists.call_loop"}
    for file in files:
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(bytes(data))
    process = start(EVALUATE, cache, cwd=tmp_path)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, out) == (0, "6.5 1\n"), err
    assert "compiled code was damaged and is made anew" in err
    assert run(EVALUATE, cache, cwd=tmp_path) == "6.5 0"
