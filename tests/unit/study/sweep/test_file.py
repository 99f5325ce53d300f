"""A sweep's file that is not as it was written is refused before any library reads it."""

import math
import os

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.internals import is_sweep
from support.plain import long_in_plain_python
from support.studies import spring
from unit.result.file.test_checksum import REFUSED, SIZE, changed_files, no_library, written

import dap3d_core as dap
from dap3d_core.result import ResultError
from dap3d_core.study.sweep import file as sweep_file

__all__ = ["no_library"]  # a fixture
ASKED = {"vary": {"forces.spring.k": [1.0, 4.0]}, "outputs": "block.r.x", "t_end": 0.1}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A sweep in a file."""
    path = tmp_path_factory.mktemp("good") / "a.nc"
    dap.sweep(spring(), **ASKED, output=path)
    return path


def test_a_byte_changed_anywhere_is_refused(good, tmp_path, no_library):
    """Nor does the library see it when somebody only asks whether it is a sweep."""
    for bad in changed_files(good, tmp_path / "bad.nc", 80):
        with pytest.raises(ResultError, match=REFUSED):
            dap.open_sweep(bad)
        assert not is_sweep(bad)


def test_of_a_large_file_the_beginning_is_compared(good, tmp_path, monkeypatch):
    """And of a small one all, whatever it says."""
    monkeypatch.setattr("dap3d_core.result.file.checksum.WHOLE", 1000)
    monkeypatch.setattr(sweep_file, "WHOLE", 1000)
    dap.sweep(spring(), **ASKED, output=tmp_path / "a.nc")
    assert dap.open_sweep(tmp_path / "a.nc").equals(dap.open_sweep(good))
    data = bytearray((tmp_path / "a.nc").read_bytes())
    data[999] ^= 1
    with pytest.raises(ResultError, match=REFUSED):
        dap.open_sweep(written(tmp_path / "b.nc", data))


def test_files_without_a_seal_are_read(good, tmp_path):
    """As older programs wrote them, and as another program leaves them that changed them."""
    expected = dap.open_sweep(good)
    old = written(tmp_path / "old.nc", good.read_bytes()[:-SIZE])
    assert dap.open_sweep(old).identical(expected)
    changed = written(tmp_path / "changed.nc", good.read_bytes())
    with netCDF4.Dataset(changed, "a") as dataset:
        dataset.setncattr("remark", "looked at")
    assert b"dap3dsum" not in changed.read_bytes()
    assert dap.open_sweep(changed).equals(expected)


@long_in_plain_python
def test_whatever_the_library_raises_is_one_sentence(good, tmp_path, monkeypatch):
    """A damaged file without a seal had it raise AttributeError; such bytes may also hang it, so
    that none are tried here."""

    def opened(*_, **__):
        raise AttributeError("NetCDF: Can't open HDF5 attribute")

    old = written(tmp_path / "a.nc.part", good.read_bytes()[:-SIZE])
    monkeypatch.setattr(netCDF4, "Dataset", opened)
    monkeypatch.setattr("dap3d_core.study.sweep.dataset.PATIENCE", 0.05)  # for one that grows
    words = r"is damaged, cut off .*\(NetCDF: Can't open HDF5 attribute\)"
    for read in (dap.open_sweep, dap.open):
        with pytest.raises(ResultError, match=words):
            read(old)
    assert not is_sweep(old)
    with pytest.raises(ResultError, match=f"cannot resume: .*{words}; move it away"):
        dap.sweep(spring(), **ASKED, output=tmp_path / "a.nc", resume=True)


def test_a_sealed_part_gets_its_name(good, tmp_path):
    """Whoever is killed between the seal and the name leaves that; the sweep goes on to its end."""
    written(tmp_path / "a.nc.part", good.read_bytes())
    found = dap.sweep(spring(), **ASKED, output=tmp_path / "a.nc", resume=True)
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]
    assert dap.open_sweep(tmp_path / "a.nc").identical(found)


@long_in_plain_python
def test_what_a_reader_hindered_is_soon_written(tmp_path, monkeypatch):
    """Not only when it would be due again: few readers keep a file for long."""
    fcntl = pytest.importorskip("fcntl")
    path, found = tmp_path / "a.nc", []
    part = tmp_path / "a.nc.part"
    monkeypatch.setattr(sweep_file, "EVERY", 0.0)
    monkeypatch.setattr(sweep_file, "SOON", 0.0)

    def progress(done, total):
        if not found:  # the file is there, and no point yet
            monkeypatch.setattr(sweep_file, "EVERY", 1000.0)
            found.append(os.open(part, os.O_RDONLY))
            fcntl.flock(found[0], fcntl.LOCK_EX)
        elif len(found) == 1:
            os.close(found[0])
            found.append(done)
        elif len(found) == 2:
            found.append(int((dap.open_sweep(part)["status"] == 1).sum()))

    vary = {"forces.spring.k": np.linspace(1.0, 4.0, 400)}
    dap.sweep(spring(), vary, outputs="block.r.x", t_end=0.1, output=path, threads=1,
              progress=progress)  # fmt: skip
    assert found[2] > found[1] > 0


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4).map(tuple), st.data())
def test_boxes_cover_a_run_of_places_once_and_in_order(shape, data):
    """Whatever the grid and the run: against the places themselves."""
    whole = np.arange(math.prod(shape))
    first = data.draw(st.integers(0, len(whole)))
    last = data.draw(st.integers(first, len(whole)))
    found = []
    for index, count in sweep_file.boxes(shape, first, last):
        block = whole.reshape(shape)[index]
        assert block.size == count > 0
        found += block.ravel().tolist()
    assert found == list(range(first, last))
    assert len(list(sweep_file.boxes(shape, first, last))) <= 2 * len(shape) - 1


def test_notes_are_cut_between_letters():
    short, long = sweep_file.note_letters(np.array(["short", "ü" * sweep_file.NOTE], dtype=object))
    assert short.tobytes().rstrip(b"\0") == b"short"
    assert len(long) == sweep_file.NOTE
    assert long.tobytes().rstrip(b"\0").decode().endswith("ü ...")
