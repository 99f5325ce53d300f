"""A compiler of C, without which nothing here can be built.
Slow tests build optimised libraries."""

import shutil

import pytest
from support.plain import jit_is_on


@pytest.fixture(autouse=True)
def _compiler(request):
    if not jit_is_on():
        pytest.skip("compiled code is exported")
    if not any(shutil.which(name) for name in ("cc", "gcc", "clang")):
        pytest.importorskip("ziglang", reason="there is no C compiler")
    if not request.node.get_closest_marker("slow"):
        request.getfixturevalue("quick_libraries")
