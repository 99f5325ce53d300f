"""The other commands, as a user meets them."""

import json

import numpy as np
import pytest

import dap3d_core as dap

CHECK_KEYS = {"bodies", "rows", "rank", "redundant", "dof", "joints", "violation"}


@pytest.mark.slow
def test_check_counts_and_runs_nothing(dap3d):
    done = dap3d.succeed("check", "fourbar3", "--json")
    found = json.loads(done.stdout)
    assert found.keys() >= CHECK_KEYS
    counted = {k: found[k] for k in ("bodies", "rows", "rank", "redundant", "dof", "joints")}
    # three moving bodies, 17 independent rows (models/fourbar3/expected.toml)
    assert counted == dict(bodies=3, rows=17, rank=17, redundant=0, dof=1, joints=[])
    assert found["violation"].keys() == {"position", "velocity"}
    assert found["violation"]["velocity"] == pytest.approx(2 * np.pi)  # the motor's, w is 0
    assert list(dap3d.folder.iterdir()) == []
    assert "no mistakes" in dap3d("check", "fourbar3").stdout


@pytest.mark.slow
def test_check_tells_redundant_joints(dap3d, scene_file):
    """A door on two hinges: ten rows, five independent."""
    hinge = 'type = "rev"\nP_i = "{p}"\nP_j = "ground.O"\na_i = "stone.z"\na_j = "ground.z"\n'
    upper = '[points.up]\nbody = "ground"\nsPp = [0.0, 0.0, 1.0]\n'
    points = upper + '[points.U]\nbody = "stone"\nsPp = [0.0, 0.0, 1.0]\n'
    lower = "[joints.low]\n" + hinge.format(p="stone.O")
    upper = "[joints.high]\n" + hinge.format(p="U").replace("ground.O", "up")
    scene_file(("[simulation]", f"{points}{lower}{upper}[simulation]"))
    done = dap3d.succeed("check", "fall.toml", "--json")
    found = json.loads(done.stdout)
    assert (found["rows"], found["rank"], found["redundant"], found["dof"]) == (10, 5, 5, 1)
    assert found["joints"] == ["low", "high"]
    told = " ".join(dap3d("check", "fall.toml").stdout.split())
    assert "redundant constraints: 5 of 10 rows" in told
    assert "The joints that share a freedom: low, high" in told
    # the hinges' axis runs through the mass centre, so no share of theirs turns the body about it
    assert "moment z alone unique: low, high" in told
    assert found["groups"] == [{"joints": ["low", "high"], "redundant": 5}]
    assert (found["everywhere"], found["redundant_elsewhere"]) == (True, 5)
    assert found["contradictions"] == []
    assert found["reactions"]["unique"] == []
    assert found["reactions"]["shared"]["low"]["unique_rows"] == []


@pytest.mark.slow
def test_models_and_plugins_are_listed(dap3d):
    shown = dap3d("models")
    listed = json.loads(dap3d("models", "--json").stdout)["models"]
    assert listed.keys() == dap.shipped_models().keys()
    assert all(name in shown.stdout for name in listed)
    assert listed["fourbar3"]["bodies"] == 3
    assert listed["fourbar3"]["joints"] == {"rev": 2, "sph": 2, "rel-rot": 1}
    assert listed["fourbar3"]["group"] == ""
    assert listed["A04"]["group"] == "benchmarks"
    lines = [line.strip() for line in shown.stdout.splitlines()]
    assert lines.count("benchmarks") == 1, "a heading above the models of the group"
    types = json.loads(dap3d("plugins", "--json").stdout)["types"]
    found = {(t["kind"], t["keyword"]): t for t in types}
    assert found["joint", "sph"]["state"] == "ok"
    assert found["joint", "sph"]["distribution"] == "dap3d"
    assert "weight" in dap3d("plugins").stdout


@pytest.mark.slow
def test_info_says_what_a_file_holds(dap3d, pen1):
    found = json.loads(dap3d("info", "pen1.nc", "--json").stdout)
    assert (found["status"], found["instants"], found["t_end"]) == ("done", 6, 0.1)
    assert found["body_names"] == ["cone"]
    assert found["settings"]["rtol"] == 1e-8
    assert found["ledger"].keys() == pen1.ledger.keys()
    shown = dap3d("info", "pen1.nc").stdout
    for words in ("cone", "J1", "llvmlite", "energy", "dop853", "project on"):
        assert words in shown


@pytest.mark.slow
def test_plot_draws_into_files(dap3d, pen1):
    dap3d.succeed("plot", "pen1.nc")
    assert (dap3d.folder / "pen1.png").read_bytes().startswith(b"\x89PNG")
    dap3d.succeed("plot", "pen1.nc", "cone.r.z", "J1.force", "--x", "cone.r.y", "-o", "a.svg")
    assert "position of cone" in (dap3d.folder / "a.svg").read_text()
