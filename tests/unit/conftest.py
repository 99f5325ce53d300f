"""Shared by unit tests: distributions to install; fewer examples with kernels as plain Python.
`make test` tries properties on all examples, and tests with all their parameters."""

import sys
import textwrap

import pytest
from hypothesis import settings
from support.plain import jit_is_on

if not jit_is_on():
    settings.register_profile("plain Python", max_examples=20)
    settings.load_profile("plain Python")


def pytest_collection_modifyitems(config, items):
    """Plain Python runs a test with its first parameters: each compiled function has the bits of
    plain Python (kernels/compiler/test_core.py). To measure coverage it runs with all."""
    if jit_is_on() or config.pluginmanager.hasplugin("_cov"):
        return
    first = {}
    for item in items:
        first.setdefault(item.nodeid.partition("[")[0], item)
    kept = set(first.values())
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = first.values()


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a distribution on sys.path: its module's text, and its entry points."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv("DAP3D_BLOCK", raising=False)
    modules = []

    def put(name, text, keyword="push", group="dap3d.forces", *, entry_points=None):
        module = name.replace("-", "_") + "_module"
        modules.append(module)
        (tmp_path / f"{module}.py").write_text(textwrap.dedent(text))
        info = tmp_path / f"{name.replace('-', '_')}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        if entry_points is None:
            entry_points = f"[{group}]\n{keyword} = {module}\n"
        (info / "entry_points.txt").write_text(entry_points)
        return module

    yield put
    for module in modules:
        sys.modules.pop(module, None)
