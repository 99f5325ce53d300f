"""The interface of plugins: joints, forces, functions and their fields."""

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.examine.examine import examine
from dap3d_core.interface.fields import (
    REQUIRED,
    Body,
    Point,
    Vector,
    Vector2,
    angle,
    body,
    choice,
    function,
    functions,
    input_,
    joint,
    matrix,
    number,
    numbers,
    point,
    table,
    vec3,
    vector,
    vector2,
)
from dap3d_core.interface.hooks import hookimpl
from dap3d_core.interface.types import INTERFACE_VERSION, Force, Function, Joint

__all__ = [
    "INTERFACE_VERSION",
    "REQUIRED",
    "Body",
    "Force",
    "Function",
    "Joint",
    "PluginError",
    "Point",
    "Vector",
    "Vector2",
    "angle",
    "body",
    "choice",
    "examine",
    "function",
    "functions",
    "hookimpl",
    "input_",
    "joint",
    "matrix",
    "number",
    "numbers",
    "point",
    "table",
    "vec3",
    "vector",
    "vector2",
]
