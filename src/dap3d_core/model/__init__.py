"""The model layer: scene -> arrays, groups, row and column pointers."""

from dap3d_core.model.groups import Group
from dap3d_core.model.model import Model, ModelError, build_model

__all__ = ["Group", "Model", "ModelError", "build_model"]
