"""What kernels are written with, in words, for whoever wrote one with something else."""

from dap3d_core import kernels
from dap3d_core.kernels import mathematics

MATHEMATICS = [n for n in kernels.__all__ if hasattr(mathematics, n) and n != "where"]
PLAINLY = (
    "branch by where(condition, a, b), not by if, while, and, or, not, min or max, and take "
    f"{', '.join(MATHEMATICS)} from dap3d_core.kernels, not from math or numpy"
)
