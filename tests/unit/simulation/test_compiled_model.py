"""A script is informed of the first compilation, once."""

import logging
import time

import pytest

import dap3d_core as dap
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.simulation.compiled_model import log_first_compilation

PLUGIN = """
from dap3d_core.interface import Body, Force, body, hookimpl

interface_version = 1


class Push(Force):
    keyword = "push"
    body_i: Body = body()

    def wrench(r_i):
        return (((r_i[0] + {number}, 0.0, 0.0), (0.0, 0.0, 0.0)),)


@hookimpl
def dap3d_forces():
    return [Push]
"""


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
def test_a_script_is_told_of_the_first_compilation_once(tmp_path, caplog):
    """A type that is new, as its number is, has to be compiled."""
    log_first_compilation.cache_clear()
    (tmp_path / "plugin.py").write_text(PLUGIN.format(number=f"{time.time_ns()}.0"))
    scene = dap.Scene(name="new")
    scene.add_body("a")
    scene.add_force("push", body_i="a")
    scene.save(tmp_path / "scene.toml")
    with caplog.at_level(logging.WARNING, "dap3d"):
        for _ in range(2):
            dap.compile(tmp_path, allow_code=True)
    told = [record for record in caplog.records if record.name == "dap3d"]
    assert [record.getMessage() for record in told] == [
        "compiling for the first time; this happens once"
    ]
    log_first_compilation.cache_clear()
    names = []
    (tmp_path / "plugin.py").write_text(PLUGIN.format(number=f"{time.time_ns()}.0"))
    dap.compile(tmp_path, allow_code=True, announce=names.append)
    assert names
    assert len([r for r in caplog.records if r.name == "dap3d"]) == 1
