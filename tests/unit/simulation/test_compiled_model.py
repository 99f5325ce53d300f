"""Scenes made ready to run: the method that is left open, and the first compilation."""

import logging
import time

import pytest
from support import problems
from support.plain import jit_is_on, long_in_plain_python

import dap3d_core as dap
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


def net():
    """4 x 4 plates of 1 m, neighbours on balls in the middles of their edges: 9 loops."""
    scene = dap.Scene(name="net")
    for k in range(16):
        i, j = divmod(k, 4)
        scene.add_body(f"b{k}", mass=1.0, Jp=(0.1, 0.1, 0.2), r=(float(i), float(j), 0.0))
        for other, edge in ((k - 4, (0.5, 0.0, 0.0)), (k - 1, (0.0, 0.5, 0.0))):
            if other >= 0 and not (j == 0 and other == k - 1):
                ends = {"P_i": (f"b{k}", [-x for x in edge]), "P_j": (f"b{other}", edge)}
                names = {
                    key: scene.add_point(f"{key}{k}_{other}", *end) for key, end in ends.items()
                }
                scene.add_joint("sph", f"J{k}_{other}", **names)
    return scene


def driven():
    """A chain whose first rod is turned by a function of time."""
    scene = problems.chain(16)
    scene.add_function("a", "motor", coeff=(0.0, 0.0, 1.0))
    scene.add_joint("rel-rot", "driver", body_i="b0", a_j="ground.z", function="motor")
    return scene


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("make", "method"),
    [
        (lambda: problems.chain(15), "standard"),  # few bodies
        (lambda: problems.chain(16), "joint"),
        (net, "lsq"),
        (driven, "standard"),
    ],
)
def test_auto_takes_joint_coordinates_for_trees_of_many_bodies(make, method, monkeypatch):
    """Neither loops nor drivers, whose rows a tree has to keep."""
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 16)
    compiled = dap.compile(make())
    assert compiled.method == method
    assert ("method joint would take some" in compiled.explain()) == (method != "joint")


@long_in_plain_python
def test_auto_keeps_coordinates_of_bodies_where_joints_rub(monkeypatch):
    """There method joint takes longer: nothing recommends it, and its runs say so."""
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 16)
    monkeypatch.setattr("dap3d_core.simulation.run.MUCH_WORK", 1)
    scene = problems.chain(16)
    scene.add_force("friction", "rubbing", joint="J3", mu=0.1, radius=0.02, v_tol=1e-3)
    result = dap.simulate(scene, t_end=0.002, dt=0.001)
    compiled = dap.compile(scene)
    assert compiled.method == result.method == "standard"
    assert "method joint" not in compiled.explain() + "".join(result.notes)
    slow = dap.simulate(scene, t_end=0.002, dt=0.001, method="joint")
    assert any("two to three times" in note and "rubbing" in note for note in slow.notes)


@long_in_plain_python
@pytest.mark.parametrize("integrator", ["radau", "auto"])
def test_auto_keeps_coordinates_of_bodies_for_integrators_that_need_them(integrator, monkeypatch):
    """Whether the scene says so, the run of a scene, or that of a compiled model."""
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 16)
    short = {"t_end": 0.002, "dt": 0.001}
    usual = dap.simulate(problems.chain(16), method="standard", integrator=integrator, **short)
    scene = problems.chain(16)
    compiled = dap.compile(scene)
    assert compiled.method == "joint"
    runs = [dap.simulate(one, integrator=integrator, **short) for one in (scene, compiled)]
    scene.simulation.integrator = integrator
    for result in (*runs, dap.simulate(scene, **short)):
        assert result.method == "standard"
        assert result.u.tobytes() == usual.u.tobytes()
    assert compiled.for_integrator("radau") is compiled.for_integrator("auto")
