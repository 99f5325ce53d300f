"""``dap3d import-matlab`` as a user meets it."""

import json
import re
import shlex
import shutil
import subprocess
import sys

import pytest
from support.matlab import MODELS
from support.process import REPOSITORY

import dap3d_core as dap


def test_what_is_written_reads_as_the_scene_of_the_library(dap3d):
    dap3d.succeed("import-matlab", MODELS / "tri")
    scene, _ = dap.import_matlab(MODELS / "tri")
    assert dap.load(dap3d.folder / "scene.toml") == scene


def test_import_takes_the_folder_too(dap3d):
    done = dap3d.succeed("import", MODELS / "ball1", "--stub")
    assert "MATLAB model ball1" in done.stdout
    folder = dap3d.folder / "ball1"
    assert {one.name for one in folder.iterdir()} == {"scene.toml", "plugin.py"}


def test_the_report_as_json(dap3d):
    done = dap3d.succeed("import-matlab", MODELS / "ball1", "--stub", "--json")
    found = json.loads(done.stdout)
    assert (found["scene"], found["plugin"]) == ("scene.toml", "plugin.py")
    assert found["holds"]["bodies"] == 1
    assert found["names"]["F1"] == "Forces(1) (S1)"
    assert {"name": "user_force.m", "state": "shown", "holds": "a force of your own"} in (
        found["files"]
    )
    assert found["user_force"] == (MODELS / "ball1" / "user_force.m").read_text()
    assert found["stub"] == (dap3d.folder / "plugin.py").read_text()
    assert found.keys() >= {"defaulted", "changed", "unused", "notes", "folder"}


@pytest.mark.slow
def test_a_stub_is_written_only_when_asked_for_and_refused_until_it_is_filled_in(dap3d):
    done = dap3d.succeed("import-matlab", MODELS / "ball1")
    assert "depth = Bodies(1).r(3) - 0.1;" in done.stdout
    assert "class UserForce(Force):" in done.stdout
    assert [p.name for p in dap3d.folder.iterdir()] == ["scene.toml"]
    run = dap3d("run", "scene.toml", "--t-end", "1", "--dt", "0.1", "--allow-code")
    assert run.returncode == 2, "there is no type of this name"
    dap3d.succeed("import-matlab", MODELS / "ball1", "--stub", "--force")
    run = dap3d("run", "scene.toml", "--t-end", "1", "--dt", "0.1", "--allow-code")
    assert run.returncode == 2
    assert "write it here" in run.stderr
    done = dap3d("import-matlab", MODELS / "pen1", "-o", "pen1.toml", "--stub")
    assert "no plugin to fill in" in " ".join(done.stdout.split())


@pytest.mark.slow
def test_lines_fit_a_narrow_terminal(dap3d):
    done = dap3d.succeed("import-matlab", MODELS / "ball1", COLUMNS=60)
    assert max(len(line) for line in done.stdout.splitlines()) <= 60


def test_files_are_not_overwritten_unasked(dap3d, refuse):
    (dap3d.folder / "plugin.py").write_text("mine")
    told = refuse("import-matlab", MODELS / "ball1", "--stub")
    assert "plugin.py exists; --force overwrites it" in told
    assert not (dap3d.folder / "scene.toml").exists(), "nothing is half written"
    (dap3d.folder / "scene.toml").write_text("mine")
    for option in ((), ("--stub",)):
        told = refuse("import-matlab", MODELS / "ball1", *option)
        assert "scene.toml exists; --force overwrites it" in told
    assert (dap3d.folder / "scene.toml").read_text() == "mine"
    assert (dap3d.folder / "plugin.py").read_text() == "mine"
    shutil.copytree(MODELS / "pen1", dap3d.folder / "pen1")
    source = dap3d.folder / "pen1" / "inBodies.m"
    before = source.read_text()
    refuse("import-matlab", "pen1", "-o", source, "--force")
    assert source.read_text() == before


def test_a_folder_takes_a_scene_toml(dap3d):
    (dap3d.folder / "mine").mkdir()
    dap3d.succeed("import-matlab", MODELS / "pen1", "-o", "mine")
    assert (dap3d.folder / "mine" / "scene.toml").exists()


@pytest.mark.slow
def test_the_page_on_importing(dap3d):
    """Its folder, its commands and its script, in this order, give what the page says."""
    text = (REPOSITORY / "docs" / "how-to" / "import-matlab.md").read_text()

    def blocks(language):
        return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)

    (dap3d.folder / "Cone").mkdir()
    files = blocks("matlab")
    for block in files:
        name = re.match(r"function (\w+)\n", block)[1]
        (dap3d.folder / "Cone" / f"{name}.m").write_text(block)
    assert len(files) == 5
    for line in re.findall(r"^    dap3d (.*)$", text, flags=re.MULTILINE):
        done = dap3d.succeed(*shlex.split(line, comments=True))
    (scene,) = blocks("toml")
    written = (dap3d.folder / "cone.toml").read_text()
    for table in scene.strip().split("\n\n"):
        assert table in written
    (script,) = blocks("python")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=dap3d.folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
