"""``dap3d export`` as a user meets it."""

import json
from pathlib import Path

import pytest

import dap3d_core as dap
from dap3d_core.cli import main


@pytest.fixture
def pen1(dap3d):
    """A result in the folder of the command line."""
    dap.simulate("pen1", t_end=0.1, dt=0.02).save(dap3d.folder / "pen1.nc")


def test_each_format_has_its_file(refuse, pen1, capfd):
    def export(*words):
        assert main(["export", "pen1.nc", *words]) == 0
        return capfd.readouterr()

    for kind, suffix in (("vtk", "vtkhdf"), ("gltf", "glb"), ("mat", "mat"), ("csv", "csv")):
        said = export("--format", kind).out
        assert f"pen1.{suffix} written" in said
        assert "6 instants" in said
        assert f"pen1.{suffix} exists" in refuse("export", "pen1.nc", "--format", kind)
    found = json.loads(export("-o", "a.glb", "--fps", "20", "--json").out)
    assert (found["file"], found["format"], found["instants"]) == ("a.glb", "gltf", 3)
    assert found["size_bytes"] == Path("a.glb").stat().st_size
    assert export("-o", "a.glb", "--force", "-q") == ("", "")


def test_all_mistakes_are_told_at_once(refuse, dap3d, pen1):
    (dap3d.folder / "pen1.mat").write_text("mine")
    words = refuse("export", "pen1.nc", "-o", "pen1.mat", "--format", "csv", "--fps", "-1")
    for told in ("its name says mat", "fps is a number above 0", "pen1.mat exists"):
        assert told in words
