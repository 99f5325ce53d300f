"""A compiler of C, without which nothing here can be built; libraries are optimised where that is
asked for."""

import shutil

import pytest
from support.plain import jit_is_on


@pytest.fixture(autouse=True)
def _compiler(request):
    if not jit_is_on():
        pytest.skip("compiled code is exported")
    if not any(shutil.which(name) for name in ("cc", "gcc", "clang")):
        pytest.importorskip("ziglang", reason="there is no C compiler")
    if "optimised_libraries" not in request.fixturenames:
        request.getfixturevalue("quick_libraries")


@pytest.fixture
def optimised_libraries():
    """Export code as users have it: the long verification does so for all models."""
