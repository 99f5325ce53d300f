"""The lowest layer: functions that kernels are written with, and the compiler.

A plugin imports only these functions; the compiler and its runtime serve the core.
"""

from typing import TYPE_CHECKING, Any

from dap3d_core.kernels.scalar_math import (
    abs,
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    exp,
    floor,
    hypot,
    log,
    maximum,
    minimum,
    mod,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from dap3d_core.kernels.table_lookup import item, lookup
from dap3d_core.kernels.vectors import (
    add,
    by_body,
    conjugate,
    cross,
    dot,
    euler_parameters,
    eye,
    hstack,
    matmul,
    neg,
    norm2,
    normals,
    quaternion_product,
    rotate,
    rotation_matrix,
    rotation_vector,
    row,
    scale,
    skew,
    sub,
    transpose,
)

if TYPE_CHECKING:
    from dap3d_core.kernels.eliminate_unknowns import root
    from dap3d_core.kernels.wrapping import (
        cable_bending,
        cable_length,
        cable_pulls,
        cable_rate,
        cable_spans,
        wrapped,
    )

__all__ = [
    "abs", "acos", "add", "asin", "atan", "atan2", "by_body", "cable_bending", "cable_length",
    "cable_pulls", "cable_rate", "cable_spans", "conjugate", "cos", "cosh", "cross", "dot",
    "euler_parameters", "exp", "eye", "floor", "hstack", "hypot", "item", "log", "lookup", "matmul",
    "maximum", "minimum", "mod", "neg", "norm2", "normals", "quaternion_product", "root", "rotate",
    "rotation_matrix", "rotation_vector", "row", "scale", "sign", "sin", "sinh", "skew", "sqrt",
    "sub", "tan", "tanh", "transpose", "where", "wrapped",
]  # fmt: skip
#: Those that few kernels need.
_WRAPPING = ("cable_bending", "cable_length", "cable_pulls", "cable_rate", "cable_spans", "wrapped")


def __getattr__(name: str) -> Any:
    """``root``, and the ways of cables, which few kernels need, with their modules."""
    if name == "root":
        from dap3d_core.kernels import eliminate_unknowns

        return eliminate_unknowns.root
    if name not in _WRAPPING:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from dap3d_core.kernels import wrapping

    return getattr(wrapping, name)
