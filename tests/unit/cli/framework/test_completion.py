"""Words offered for completion: commands, models, parameters, quantities, outputs of a sweep."""

import os
import subprocess
import sys

import attrs
import pytest
from click.shell_completion import ShellComplete
from support.command_line import dap3d
from support.plain import in_another_process

import dap3d_core as dap
from dap3d_core.result import UnknownNameError, find, names_of

MOTION = ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd")


@pytest.fixture(scope="module")
def result():
    """A cone on a ball joint, without its weight, which has no quantities."""
    scene = attrs.evolve(dap.load("pen1"), forces={}, outputs={"tilt": "acos(cone.r.z)"})
    return dap.simulate(scene, t_end=0.02, dt=0.02)


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    """A folder with a result, a.nc."""
    folder = tmp_path_factory.mktemp("results")
    result.save(folder / "a.nc")
    return folder


@pytest.mark.parametrize(
    ("begin", "expected"),
    [
        ("cone.w", ["cone.wp", "cone.wd", "cone.wpd"]),
        ("cone.r.", ["cone.r.x", "cone.r.y", "cone.r.z", "cone.r.norm"]),
        ("cone.p.", ["cone.p.e0", "cone.p.e1", "cone.p.e2", "cone.p.e3"]),
        ("P1.", ["P1.r", "P1.v", "P1.a"]),
        ("J1.mom", ["J1.moment", "J1.moment_body", "J1.moment_at_point"]),
        ("J1.j.f", ["J1.j.force", "J1.j.force_body"]),
        ("J1.lambda.", ["J1.lambda.1", "J1.lambda.2", "J1.lambda.3"]),
        ("J1.q2", ["J1.q2_dot"]),
        ("til", ["tilt"]),
        ("energy.", ["energy.kinetic", "energy.potential", "energy.total"]),
        ("cone", [f"cone.{a}" for a in (*MOTION, "roll", "pitch", "yaw")]),
        ("nothing", []),
        ("cone.none.", []),
    ],
)
def test_names_continue_by_one_part(result, begin, expected):
    """The quantities of a single owner are offered at once."""
    assert names_of(result, begin) == expected


def test_offered_names_exist(result):
    """Every offered name that does not end in a dot is a quantity; so are its components."""
    todo, count = names_of(result), 0
    assert {"cone.", "P1.", "J1.", "t", "work", "energy.total"} <= set(todo)
    while todo:
        name = todo.pop()
        if not name.endswith("."):
            find(result, name)
            count += 1
            name += "."
        todo += names_of(result, name) if name.count(".") < 4 else []
    assert count > 60
    with pytest.raises(UnknownNameError):
        find(result, "cone.rr")


def offered(*words):
    """Kinds and words offered in this process for a command line whose last word is incomplete."""
    complete = ShellComplete(dap3d, {}, "dap3d", "_DAP3D")
    return [(item.type, item.value) for item in complete.get_completions([*words[:-1]], words[-1])]


def completions(*words):
    return [word for _, word in offered(*words)]


@pytest.mark.slow
@in_another_process
def test_a_shell_gets_words_and_their_types(folder):
    variables = {"COMP_WORDS": "dap3d plot a.nc cone.r.", "COMP_CWORD": "3",
                 "_DAP3D_COMPLETE": "bash_complete"}  # fmt: skip
    script = "from dap3d_core.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, text=True,
                          env=os.environ | variables, capture_output=True)  # fmt: skip
    assert done.stderr == ""
    assert done.stdout.splitlines() == [f"plain,cone.r.{part}" for part in ("x", "y", "z", "norm")]


def test_words_and_their_types(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert ("plain", "energy.total") in offered("plot", "a.nc", "cone.r", "--x", "en")
    assert offered("plot", "a.") == [("file", "a.")]
    assert offered("plot", "gone.nc", "cone") == [("file", "cone")]
    assert ("plain", "fourbar3") in offered("run", "four")
    assert ("plain", "animate") in offered("an")


def test_parameters_of_a_model():
    """Part by part; none if there is no such model."""
    sweep = ("sweep", "pen1", "--vary")
    assert "bodies." in completions(*sweep, "")
    assert completions(*sweep, "bodies.") == ["bodies.cone."]
    assert "bodies.cone.mass" in completions(*sweep, "bodies.cone.")
    assert completions(*sweep, "bodies.cone.w.") == [f"bodies.cone.w.{axis}" for axis in "xyz"]
    assert completions("sweep", "none", "--vary", "bo") == []


def test_outputs_of_a_sweep(tmp_path):
    file = tmp_path / "s.nc"
    outputs = ["J1.force.norm:max", "J1.force.norm"]
    dap.sweep("pen1", {"bodies.cone.mass": [1.0]}, outputs=outputs, t_end=0.02, dt=0.02,
              output=file)  # fmt: skip
    assert completions("plot", str(file), "J1") == outputs
    assert "status" not in completions("plot", str(file), "")


def test_coordinates_of_joints_are_offered_for_a_file(folder):
    """They need the model, which is made from the scene in the file."""
    assert completions("plot", str(folder / "a.nc"), "J1.q") == [
        "J1.q1", "J1.q2", "J1.q3", "J1.q1_dot", "J1.q2_dot", "J1.q3_dot",
    ]  # fmt: skip
