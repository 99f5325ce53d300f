"""Files of the cache of compiled code: one that is not as it was written is never used."""

import random
import warnings

import pytest

from dap3d_core.kernels.runtime.sealed_files import sealed, sealed_content


def test_a_file_gives_back_what_was_written(tmp_path):
    content = random.Random(1).randbytes(1000)
    (tmp_path / "whole").write_bytes(sealed(content))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sealed_content(tmp_path / "whole") == content
        assert sealed_content(tmp_path / "missing") is None


@pytest.mark.parametrize("place", [0, 20, 40, -66, -40, -1])
def test_one_bit_condemns_a_file_once(tmp_path, place):
    """Also a bit of the checksum. The file is removed, and so found missing the next time."""
    data = bytearray(sealed(b"some code that is compiled, and more of it"))
    data[place] ^= 4
    (tmp_path / "code").write_bytes(data)
    with pytest.warns(RuntimeWarning, match="damaged and is made anew"):
        assert sealed_content(tmp_path / "code") is None
    assert not (tmp_path / "code").exists()


@pytest.mark.parametrize("count", [0, 1, 73, 100])
def test_a_file_that_is_cut_off_is_not_used(tmp_path, count):
    (tmp_path / "code").write_bytes(sealed(bytes(50))[:count])
    with pytest.warns(RuntimeWarning):
        assert sealed_content(tmp_path / "code") is None
