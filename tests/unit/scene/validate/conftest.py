"""The installed types, and scenes from files."""

import pytest
from unit.scene.base import scene_of as read_scene

from dap3d_core.registry import load_registry


@pytest.fixture(scope="package")
def registry():
    return load_registry()


@pytest.fixture
def scene_of(tmp_path):
    """A scene read from a file of this text."""
    return lambda text: read_scene(tmp_path, text)
