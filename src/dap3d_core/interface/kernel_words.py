"""What kernels are written with, in words, for whoever wrote one with something else."""

from dap3d_core.kernels import __all__ as words
from dap3d_core.kernels import scalar_math

MATHEMATICS = [name for name in words if hasattr(scalar_math, name) and name != "where"]
PLAINLY = (
    "branch by where(condition, a, b), not by if, while, and, or, not, min or max, and take "
    f"{', '.join(MATHEMATICS)} from dap3d_core.kernels, not from math or numpy"
)
