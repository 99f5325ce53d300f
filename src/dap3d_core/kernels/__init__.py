"""The lowest floor: what kernels are written with, and how they become fast.

A plugin imports from here only the words of its formulas; ``compiled``, the loops and their cache
serve the core.
"""

from dap3d_core.kernels.scalar_math import (
    abs,
    acos,
    asin,
    atan2,
    cos,
    exp,
    floor,
    hypot,
    log,
    maximum,
    minimum,
    sin,
    sqrt,
    tanh,
    where,
)
from dap3d_core.kernels.table_lookup import lookup
from dap3d_core.kernels.vectors import (
    add,
    cross,
    dot,
    eye,
    hstack,
    neg,
    norm2,
    normals,
    rotate,
    row,
    scale,
    skew,
    sub,
)

__all__ = [
    "abs",
    "acos",
    "add",
    "asin",
    "atan2",
    "cos",
    "cross",
    "dot",
    "exp",
    "eye",
    "floor",
    "hstack",
    "hypot",
    "log",
    "lookup",
    "maximum",
    "minimum",
    "neg",
    "norm2",
    "normals",
    "rotate",
    "row",
    "scale",
    "sin",
    "skew",
    "sqrt",
    "sub",
    "tanh",
    "where",
]
