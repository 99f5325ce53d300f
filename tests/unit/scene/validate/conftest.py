"""The installed types, and scenes from files."""

import pytest
from unit.scene.base import scene_of as read_scene

import dap3d_core as dap


@pytest.fixture(scope="package")
def registry():
    return dap.load_registry()


@pytest.fixture
def scene_of(tmp_path):
    """A scene read from a file of this text."""
    return lambda text: read_scene(tmp_path, text)
