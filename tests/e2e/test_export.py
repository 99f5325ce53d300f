"""``dap3d export`` as a user meets it."""

import json

import pytest

import dap3d_core as dap


@pytest.fixture
def pen1(dap3d):
    """A result in the folder of the command line."""
    dap.simulate("pen1", t_end=0.1, dt=0.02).save(dap3d.folder / "pen1.nc")


def test_each_format_has_its_file(dap3d, refuse, pen1):
    for kind, suffix in (("vtk", "vtkhdf"), ("gltf", "glb"), ("mat", "mat"), ("csv", "csv")):
        done = dap3d("export", "pen1.nc", "--format", kind)
        assert done.returncode == 0, done.stderr
        assert f"pen1.{suffix} written" in done.stdout
        assert "6 instants" in done.stdout
        assert f"pen1.{suffix} exists" in refuse("export", "pen1.nc", "--format", kind)
    told = dap3d("export", "pen1.nc", "-o", "a.glb", "--fps", "20", "--json")
    found = json.loads(told.stdout)
    assert (found["file"], found["format"], found["instants"]) == ("a.glb", "gltf", 3)
    assert found["size_bytes"] == (dap3d.folder / "a.glb").stat().st_size
    silent = dap3d("export", "pen1.nc", "-o", "a.glb", "--force", "-q")
    assert (silent.returncode, silent.stdout, silent.stderr) == (0, "", "")


def test_all_mistakes_are_told_at_once(refuse, dap3d, pen1):
    (dap3d.folder / "pen1.mat").write_text("mine")
    words = refuse("export", "pen1.nc", "-o", "pen1.mat", "--format", "csv", "--fps", "-1")
    for told in ("its name says mat", "fps is a number above 0", "pen1.mat exists"):
        assert told in words
