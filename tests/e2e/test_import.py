"""``dap3d import`` and ``dap3d export`` of models, as a user runs them."""

import json
import shutil

import pytest
from support.process import REPOSITORY

DATA = REPOSITORY / "tests" / "data" / "formats"


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """A folder with a model, in which commands work."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DATA / "arm.urdf", tmp_path)
    return tmp_path


def test_a_model_becomes_a_folder_that_runs(dap3d, arm):
    done = dap3d.succeed("import", "arm.urdf")
    assert "arm.urdf:36: " in done.stdout
    dap3d.succeed("run", "arm", "--t-end", "0.05")


def test_the_report_for_programs(dap3d, arm):
    done = dap3d("import", "arm.urdf", "-o", "out", "--json", "--position", "shoulder=0.5")
    data = json.loads(done.stdout)
    assert data["taken"] == {"links": 4, "joints": 3, "couplings": 0, "actuators": 0}
    assert {"file", "line", "text", "count", "motion"} == set(data["left_out"][0])
    assert (arm / "out" / "scene.toml").is_file()


def test_limits_may_be_hard_or_off(dap3d, arm):
    """What changes the motion is said first."""
    said = dap3d("import", "arm.urdf", "--limits", "hard").stdout
    assert said.index("the motion is another") < said.index("left out\n")
    scene = (arm / "arm" / "scene.toml").read_text()
    assert "lower = -1.0" in scene
    assert "_stop" not in scene
    dap3d.succeed("import", "arm.urdf", "--limits", "off", "-o", "free")
    assert "_stop" not in (arm / "free" / "scene.toml").read_text()


def test_nothing_is_overwritten_without_force(dap3d, refuse, arm):
    dap3d.succeed("import", "arm.urdf")
    assert "exists; --force" in refuse("import", "arm.urdf")
    dap3d.succeed("import", "arm.urdf", "--force")
    dap3d.succeed("export", "arm", "--format", "mjcf")
    assert "exists; --force" in refuse("export", "arm", "--format", "mjcf")
    assert dap3d.succeed("export", "arm", "--format", "mjcf", "--force", "--quiet").stdout == ""


def test_output_is_a_folder(refuse, arm):
    said = refuse("import", "arm.urdf", "-o", "arm.toml")
    assert "arm.toml looks like a file; -o names the folder for scene.toml and the meshes" in said
    assert not (arm / "arm.toml").exists()
    assert "arm.urdf is a file; -o names" in refuse("import", "arm.urdf", "-o", "arm.urdf")
