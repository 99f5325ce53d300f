"""Shared by tests of MATLAB models."""

import pytest
from support.matlab import write

import dap3d_core as dap


@pytest.fixture
def mistakes(tmp_path):
    """The mistakes of the small model with some files replaced, as messages without the folder."""

    def call(**files):
        folder = write(tmp_path / "small", **files)
        with pytest.raises(dap.SceneError) as caught:
            dap.import_matlab(folder)
        return [str(m).replace(f"{folder}/", "") for m in caught.value.mistakes]

    return call
