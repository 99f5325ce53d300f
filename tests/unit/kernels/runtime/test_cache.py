"""The digest under which compiled code of the core is kept."""

import shutil
from pathlib import Path

import pytest

import dap3d_core
from dap3d_core.kernels.runtime import cache


@pytest.fixture
def core(tmp_path, monkeypatch):
    """A copy of the core's sources that the digest reads."""
    source = Path(dap3d_core.__file__).parent
    root = shutil.copytree(source, tmp_path / "core", ignore=shutil.ignore_patterns("*.pyc"))
    monkeypatch.setattr(cache, "__file__", str(root / "kernels/runtime/cache.py"))
    return root


def test_a_change_in_a_sub_folder_changes_the_digest(core):
    """Else stale code would be run; floors above do not count."""
    digest = cache.driver_digest.__wrapped__
    before = digest("formulations"), digest("integrators")
    with (core / "integrators/radau/step.py").open("a") as file:
        file.write("# changed\n")
    assert digest("formulations") == before[0]
    assert digest("integrators") != before[1]


def test_files_that_change_places_change_the_digest(core):
    """Names are compared with their folders: a step.py is in several."""
    before = cache.driver_digest.__wrapped__("integrators")
    one, other = (core / f"integrators/{name}/step.py" for name in ("adams", "radau"))
    texts = one.read_bytes(), other.read_bytes()
    one.write_bytes(texts[1])
    other.write_bytes(texts[0])
    assert cache.driver_digest.__wrapped__("integrators") != before
