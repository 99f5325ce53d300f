"""The interface of plugins: joints, forces, functions and their fields."""

from dap3d_core.interface.contacts.contact import Contact
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.examine.examine import examine
from dap3d_core.interface.fields import (
    REQUIRED,
    Body,
    Point,
    Vector,
    Vector2,
    angle,
    bodies,
    body,
    choice,
    function,
    functions,
    input_,
    joint,
    joint_fields,
    matrix,
    number,
    numbers,
    point,
    points,
    square,
    table,
    vec3,
    vector,
    vector2,
    vectors,
)
from dap3d_core.interface.hooks import hookimpl
from dap3d_core.interface.types import INTERFACE_VERSION, Force, Function, Joint

__all__ = [
    "INTERFACE_VERSION", "REQUIRED", "Body", "Contact", "Force", "Function", "Joint", "PluginError",
    "Point", "Vector", "Vector2", "angle", "bodies", "body", "choice", "examine", "function",
    "functions", "hookimpl", "input_", "joint", "joint_fields", "matrix", "number", "numbers",
    "point", "points", "square", "table", "vec3", "vector", "vector2", "vectors",
]  # fmt: skip
