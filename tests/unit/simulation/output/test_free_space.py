"""Runs that would fill the memory or the disk."""

import shutil
from types import SimpleNamespace

import pytest
from support.internals import free_space

import dap3d_core as dap


@pytest.fixture
def small(monkeypatch):
    """A machine of 1 GiB of memory and 2 GiB of disk."""
    monkeypatch.setattr(free_space, "_free_memory", lambda: 2**30)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=2 * 2**30))


def test_what_fits_is_taken(small, tmp_path):
    free_space.check_room(600, 100_000, 0.1, None)
    free_space.check_room(1200, 100_000, 0.1, tmp_path / "x.nc")


def test_memory_bounds_a_run_without_a_file(small):
    with pytest.raises(dap.SceneError) as caught:
        free_space.check_room(10_000, 100_000, 1e-3, None)
    (mistake,) = caught.value.mistakes
    assert mistake.key == "dt"
    assert "10,000 instants of 100,000 numbers, 14.9 GiB" in mistake.what
    assert "1 GiB in memory" in mistake.what
    assert "dt of at least 0.0298" in mistake.remedy
    assert "-o" in mistake.remedy


def test_the_disk_bounds_a_run_with_a_file(small, tmp_path):
    with pytest.raises(dap.SceneError, match=r"14\.9 GiB; there is room for 2 GiB on the disk"):
        free_space.check_room(10_000, 100_000, None, tmp_path / "x.nc")


def test_a_run_is_refused_before_it_begins(small, tmp_path, monkeypatch):
    """In the library and on the command line, with the name of the option."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    monkeypatch.setattr(free_space, "_free_memory", lambda: 2**25)
    with pytest.raises(dap.SceneError, match="there is room for"):
        dap.simulate(scene, t_end=1.0, dt=1e-6)
    scene.save(tmp_path / "scene.toml")
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=1))
    from dap3d_core.cli import main

    words = ["run", str(tmp_path), "--t-end", "1", "--dt", "1e-6", "-o", str(tmp_path / "x.nc")]
    assert main([*words, "-q"]) == 2
    assert not list(tmp_path.glob("x.nc*"))


def test_the_machine_says_what_it_has():
    found = free_space._free_memory()
    assert found is None or 2**20 < found < 2**60
