"""Modules that a second process compiles."""

import pytest

from dap3d_core.native import beside
from dap3d_core.native.build import PLATFORMS, own_platform

TEXT = "define hidden double @f{k}(double %x) {{\nentry:\n  ret double %x\n}}\n"


@pytest.mark.parametrize("fails", [False, True])
def test_object_files_are_there_wherever_they_are_compiled(tmp_path, monkeypatch, fails):
    """Also where no second process can be started."""
    monkeypatch.setattr(beside, "LEAST", 0)
    monkeypatch.setattr(beside, "core_count", lambda: 2)
    modules = [beside.Module(TEXT.format(k=k), 0, tmp_path / f"{k}.o") for k in range(3)]
    if fails:
        monkeypatch.setattr(beside.sys, "executable", "no such program")
    beside.compile_modules(modules, PLATFORMS[own_platform()].processor)
    assert all(b"f" in module.file.read_bytes() for module in modules)
    assert list(tmp_path.glob("*.ll"))  # some were for the second process
