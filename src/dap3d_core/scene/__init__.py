"""Scenes: description, scene files, validation."""

from dap3d_core.scene.errors import MISSING, Mistake, SceneError
from dap3d_core.scene.files.read_toml import load, parse, shipped_models, tables_of
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import (
    Animation,
    AnimationPoint,
    Body,
    Element,
    Point,
    Simulation,
    Vector,
    Vector2,
)
from dap3d_core.scene.validate.mistake_collector import mistake_at
from dap3d_core.scene.validate.settings import check_simulation
from dap3d_core.scene.validate.validate import check
from dap3d_core.scene.validate.validated_scene import Instance, ValidatedScene

__all__ = [
    "MISSING", "Animation", "AnimationPoint", "Body", "ValidatedScene", "Element", "Instance",
    "Mistake", "Point", "Scene", "SceneError", "Simulation", "Vector", "Vector2", "check",
    "check_simulation", "load", "mistake_at", "parse", "shipped_models", "tables_of",
]  # fmt: skip
