"""What the tab key offers: quantities of the result that was named, part by part, and models."""

import os
import subprocess
import sys

import pytest
from support.plain import in_another_process
from unit.test_result import circling

from dap3d_core.result import UnknownNameError, find, names_of


@pytest.fixture(scope="module")
def result():
    return circling()[0]


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    """A folder with a result."""
    folder = tmp_path_factory.mktemp("results")
    result.save(folder / "a.nc")
    return folder


def test_owners_come_first(result):
    found = names_of(result)
    assert [name for name in found if name.endswith(".")] == ["bob.", "Q.", "H.", "P.", "J1."]
    assert {"t", "work", "energy.total", "constraint.position"} <= set(found)


@pytest.mark.parametrize(
    ("begin", "expected"),
    [
        ("bob.w", ["bob.w", "bob.wp", "bob.wd", "bob.wpd"][1:]),
        ("bob.r.", ["bob.r.x", "bob.r.y", "bob.r.z", "bob.r.norm"]),
        ("bob.p.", ["bob.p.e0", "bob.p.e1", "bob.p.e2", "bob.p.e3"]),
        ("P.", ["P.r", "P.v", "P.a"]),
        ("J1.mom", ["J1.moment", "J1.moment_body", "J1.moment_at_point"]),
        ("J1.j.f", ["J1.j.force", "J1.j.force_body"]),
        ("J1.lambda.", ["J1.lambda.1", "J1.lambda.2", "J1.lambda.3"]),
        ("energy.", ["energy.kinetic", "energy.potential", "energy.total"]),
        ("con", ["constraint.position", "constraint.velocity", "constraint.acceleration"]),
        ("nothing", []),
        ("bob.none.", []),
    ],
)
def test_names_go_on_by_one_part(result, begin, expected):
    assert names_of(result, begin) == expected


def test_a_single_owner_is_opened_at_once(result):
    assert names_of(result, "bo") == [f"bob.{a}" for a in
                                      ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd")]  # fmt: skip


def test_what_is_offered_exists(result):
    """Every offered name that does not end in a dot is a quantity; so are its components."""
    todo, count = names_of(result), 0
    while todo:
        name = todo.pop()
        if not name.endswith("."):
            find(result, name)
            count += 1
            name += "."
        todo += names_of(result, name) if name.count(".") < 4 else []
    assert count > 60
    with pytest.raises(UnknownNameError):
        find(result, "bob.rr")


def offered(folder, *words):
    """What a shell is told for a command line whose last word is incomplete."""
    line = " ".join(["dap3d", *words])
    variables = {"COMP_WORDS": line, "COMP_CWORD": str(len(words)),
                 "_DAP3D_COMPLETE": "bash_complete"}  # fmt: skip
    script = "from dap3d_core.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, env=os.environ | variables,
                          capture_output=True, text=True)  # fmt: skip
    assert done.stderr == ""
    return [tuple(item.split(",", 1)) for item in done.stdout.splitlines()]


@pytest.mark.slow
@in_another_process
def test_a_shell_is_told(folder):
    assert offered(folder, "plot", "a.nc", "bob.r.") == [
        ("plain", f"bob.r.{part}") for part in ("x", "y", "z", "norm")
    ]
    assert ("plain", "energy.total") in offered(folder, "plot", "a.nc", "bob.r", "--x", "en")
    assert offered(folder, "plot", "a.") == [("file", "a.")]
    assert offered(folder, "plot", "gone.nc", "bob") == [("file", "bob")]
    assert ("plain", "fourbar3") in offered(folder, "run", "four")
    assert ("plain", "animate") in offered(folder, "an")


def offered_here(words):
    """What a shell is offered behind words of a command line; the last one is incomplete."""
    from click.shell_completion import ShellComplete

    from dap3d_core.cli.app import dap3d

    *before, last = words
    return [item.value for item in ShellComplete(dap3d, {}, "dap3d", "_DAP3D").get_completions(
        before, last)]  # fmt: skip


def test_numbers_of_a_model_are_offered_here():
    """For what varies, part by part; nothing where there is no such model."""
    sweep = ["sweep", "pen1", "--vary"]
    assert "bodies." in offered_here([*sweep, ""])
    assert offered_here([*sweep, "bodies."]) == ["bodies.cone."]
    assert "bodies.cone.mass" in offered_here([*sweep, "bodies.cone."])
    assert offered_here([*sweep, "bodies.cone.w."]) == [f"bodies.cone.w.{axis}" for axis in "xyz"]
    assert offered_here(["sweep", "none", "--vary", "bo"]) == []


def test_outputs_of_a_sweep_are_offered(tmp_path):
    """Where a result offers its quantities."""
    from unit.test_plot_sweep import grid

    data = grid(mass=[1, 2], k=[3, 4]).drop_vars("note")
    file = tmp_path / "s.nc"
    data.assign_attrs(scene="", versions="{}", outputs="[]").assign(
        note=data["status"].astype(str)
    ).to_netcdf(file)
    assert offered_here(["plot", str(file), "J1"]) == ["J1.force.norm:max", "J1.force.norm"]
    assert "status" not in offered_here(["plot", str(file), ""])
