"""What the user described: classes for it, reading and writing scene files, and their check."""

from dap3d_core.scene.checked import Checked, Instance
from dap3d_core.scene.checking import check
from dap3d_core.scene.collector import mistake_at
from dap3d_core.scene.description import (
    Animation,
    AnimationPoint,
    Body,
    Element,
    Point,
    Scene,
    Simulation,
    Vector,
    Vector2,
)
from dap3d_core.scene.mistakes import MISSING, Mistake, SceneError
from dap3d_core.scene.reading import load, parse, shipped_models, tables_of
from dap3d_core.scene.settings import INTEGRATORS, METHODS, check_simulation

__all__ = [
    "INTEGRATORS",
    "METHODS",
    "MISSING",
    "Animation",
    "AnimationPoint",
    "Body",
    "Checked",
    "Element",
    "Instance",
    "Mistake",
    "Point",
    "Scene",
    "SceneError",
    "Simulation",
    "Vector",
    "Vector2",
    "check",
    "check_simulation",
    "load",
    "mistake_at",
    "parse",
    "shipped_models",
    "tables_of",
]
