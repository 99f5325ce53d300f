"""Bad input as a user of the command line meets it: words, exit codes, and what is left behind."""

import json

import pytest
from bad_input.case import PENDULUM, ROD, changed, driven

from dap3d_core.cli import main


@pytest.fixture
def run(tmp_path, monkeypatch, capfd):
    """Runs a command on a scene, in this process: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(text, *arguments):
        (tmp_path / "scene.toml").write_text(text)
        code = main([str(a) for a in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        assert "unexpected" not in err
        return code, out, " ".join(err.split())

    return call


SPOILED = changed(
    PENDULUM,
    ("mass = 1.0", "mas = 1.0"),
    ("Jp = [0.1, 0.1, 0.05]", "Jp = [0.1, 0.1]"),
    ('P_j = "ground.O"', 'P_j = "grund.O"'),
    ("dt = 0.02", "dt = -0.02"),
)


def test_mistakes_are_json_too(run):
    code, out, _ = run(SPOILED, "check", "scene.toml", "--json")
    found = json.loads(out)
    assert (code, found["exit_code"], len(found["mistakes"])) == (2, 2, 4)
    assert found["mistakes"][0]["nearest"] == "mass"
    assert all(m["file"] == "scene.toml" and m["line"] for m in found["mistakes"])


@pytest.mark.parametrize("command", ["check", "run"])
def test_what_types_refuse_is_told_for_all_elements(run, tmp_path, command):
    """Two functions and a friction, none of which its own type takes."""
    text = changed(
        driven('type = "b"\nx_start = 2.0'),
        add='[joints.again]\ntype = "rel-rot"\nbody_i = "rod"\na_j = "ground.x"\nfunction = "n"\n'
        '[functions.n]\ntype = "spline"\nx = [0.0, 0.0]\ny = [1.0, 2.0]\n'
        '[forces.rub]\ntype = "friction"\njoint = "hinge"\nv_tol = 1e-3\n',
    )
    code, out, err = run(text, command, "scene.toml")
    assert (code, out) == (2, "")
    assert err.startswith("3 mistakes:")
    for table, words in (
        ("functions.f", "x_end = 1 must lie beyond x_start = 2"),
        ("functions.n", "x must increase"),
        ("forces.rub", "radius is missing"),
    ):
        line = 1 + text.splitlines().index(f"[{table}]")
        assert f"scene.toml:{line}: {table}: {words}" in err
    assert not (tmp_path / "scene.nc").exists()


def test_joints_that_contradict_each_other_leave_nothing(run, tmp_path):
    text = changed(
        PENDULUM,
        add='[points.C]\nbody = "ground"\nsPp = [0, 0, 1]\n'
        '[joints.two]\ntype = "sph"\nP_i = "A"\nP_j = "C"\n',
    )
    code, _, err = run(text, "run", "scene.toml")
    assert code == 1
    lines = text.splitlines()
    for joint in ("hinge", "two"):
        assert f"scene.toml:{1 + lines.index(f'[joints.{joint}]')}: joints.{joint}" in err
    assert not (tmp_path / "scene.nc").exists()
    code, out, _ = run(text, "check", "scene.toml")
    assert code == 2
    assert "joints.two" in " ".join(out.split())


def test_what_is_odd_runs_and_counts_under_strict(run, tmp_path):
    text = changed(ROD, ('type = "weight"', 'type = "weight"\nwgt = [0, 0, -2]'))
    code, out, _ = run(text, "run", "scene.toml")
    assert code == 0
    assert "forces.g.wgt = [0, 0, -2] is a direction of length 2" in " ".join(out.split())
    assert run(text, "run", "scene.toml", "--strict", "--force")[0] == 1
    assert (tmp_path / "scene.nc").exists()
