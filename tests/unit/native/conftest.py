"""A compiler of C, without which nothing here can be built."""

import shutil

import pytest

from dap3d_core.kernels.runtime.cache import jit_is_on


@pytest.fixture(autouse=True)
def _compiler(quick_libraries):
    if not jit_is_on():
        pytest.skip("compiled code is exported")
    if not any(shutil.which(name) for name in ("cc", "gcc", "clang")):
        pytest.importorskip("ziglang", reason="there is no C compiler")
