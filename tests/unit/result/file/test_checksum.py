"""A result file that is not as it was written is refused before any library reads it."""

import shutil
from contextlib import closing

import netCDF4
import numpy as np
import pytest
import xarray
from support.internals import checksum
from support.results import circling, grown, same_bits

from dap3d_core.result import ResultError, open_result

SIZE = 40
REFUSED = r"cannot read .*: it is (damaged|cut off).*; take another copy of it, or run again$"


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A result in a file."""
    path = tmp_path_factory.mktemp("good") / "run.nc"
    circling(nt=50)[0].save(path)
    return path


@pytest.fixture
def part(tmp_path):
    """A file that grew, as a killed run leaves it."""
    result, _, _ = circling(nt=50)
    with closing(grown(tmp_path / "run.nc", result, most=400)) as writer:
        writer.append(result.arrays)
    return writer.part


def written(path, data):
    path.write_bytes(bytes(data))
    return path


@pytest.fixture
def no_library(monkeypatch):
    """Whoever asks the NetCDF library to open a file fails, whatever becomes of the exception."""
    asked = []

    def opened(file, *_, **__):
        asked.append(file)
        raise AssertionError("the library reads the file")

    monkeypatch.setattr(netCDF4, "Dataset", opened)
    yield
    assert asked == []


def places_in(size, count, seed):
    """Places over a file, the last bytes, the seal, each among them."""
    some = np.random.default_rng(seed).integers(size, size=count)
    return [*some.tolist(), *range(size - SIZE, size)]


def changed_files(good, path, count):
    """The file with a byte changed, at so many places and in each byte of the seal."""
    data, rng = good.read_bytes(), np.random.default_rng(1)
    for at in places_in(len(data), count, 2):
        changed = bytearray(data)
        changed[at] ^= int(rng.integers(1, 256))
        if at >= 8:  # or it has not HDF5's signature
            yield written(path, changed)


def test_a_byte_changed_anywhere_and_more_at_the_end_are_refused(good, tmp_path, no_library):
    data = good.read_bytes()
    longer = (written(tmp_path / "long.nc", data + more)
              for more in (b"\0", b"x" * 1000, data[-SIZE:]))  # fmt: skip
    for bad in (*changed_files(good, tmp_path / "bad.nc", 150), *longer):
        with pytest.raises(ResultError, match=REFUSED):
            open_result(bad)


def test_a_file_cut_off_anywhere_says_so(good, tmp_path, no_library):
    data = good.read_bytes()
    for size in [*np.random.default_rng(3).integers(48, len(data) - SIZE, size=40)] + [
        len(data) - k for k in (1, 2, 20, SIZE - 1, SIZE + 1)
    ]:
        words = f"it is cut off, or damaged: {size} of {len(data)} bytes are there"
        with pytest.raises(ResultError, match=words):
            open_result(written(tmp_path / "cut.nc", data[:size]))


def test_what_describes_a_growing_file_is_sealed(part, tmp_path, no_library):
    """Its rows are not: they come after the seal."""
    data = part.read_bytes()
    *_, rows, size, _, _ = checksum._LAYOUT.unpack(data[-SIZE:])
    assert size == len(data) - SIZE
    for at in [*np.random.default_rng(4).integers(48, rows, size=80)]:
        changed = bytearray(data)
        changed[at] ^= 1
        with pytest.raises(ResultError, match=REFUSED):
            open_result(written(tmp_path / "bad.nc", changed))


def test_a_growing_file_is_read_at_any_moment(tmp_path):
    """Nor does closing it change what was sealed."""
    result, _, _ = circling(nt=200)
    path = tmp_path / "run.nc.part"
    with closing(grown(tmp_path / "run.nc", result)) as writer:
        checksum.check_checksums(path)
        for first in range(0, 200, 50):
            writer.append(result.arrays.part(slice(first, first + 50)))
            checksum.check_checksums(path)
            shutil.copy(path, tmp_path / "copy.nc")
            assert len(open_result(tmp_path / "copy.nc").t) == first + 50
    assert same_bits(open_result(path), result)
    data = path.read_bytes()
    *_, rows, size, _, _ = checksum._LAYOUT.unpack(data[-SIZE:])
    assert size - rows >= 8 * 200 * result.arrays.width  # no row lies in what was sealed


def test_of_a_large_file_what_describes_it_is_compared(good, tmp_path, monkeypatch):
    monkeypatch.setattr(checksum, "WHOLE", 1000)
    assert same_bits(open_result(good), circling(nt=50)[0])
    data = bytearray(good.read_bytes())
    *_, rows, _, _, _ = checksum._LAYOUT.unpack(data[-SIZE:])
    data[rows + 1000] ^= 1
    open_result(written(tmp_path / "a.nc", data))
    data[rows - 1000] ^= 1
    with pytest.raises(ResultError, match=REFUSED):
        open_result(written(tmp_path / "b.nc", data))


def test_files_without_a_seal_are_read(good, part, tmp_path):
    """As older programs wrote them."""
    for path in (good, part):
        found = open_result(written(tmp_path / "old.nc", path.read_bytes()[:-SIZE]))
        assert same_bits(found, open_result(path))


def test_a_file_that_another_program_changed_is_read(good, tmp_path):
    """The library cuts the seal off, so that it says nothing false."""
    path = tmp_path / "changed.nc"
    shutil.copy(good, path)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.setncattr("remark", "looked at")
    assert b"dap3dsum" not in path.read_bytes()
    assert same_bits(open_result(path), open_result(good))


def test_xarray_reads_a_sealed_file(good, part):
    """As any program does that reads with HDF5; h5py 3.16 and h5netcdf were tried as well."""
    for path in (good, part):
        with xarray.open_dataset(path) as found:
            rows = found["u"].to_numpy()[:50]
        np.testing.assert_array_equal(rows, open_result(good).u)
