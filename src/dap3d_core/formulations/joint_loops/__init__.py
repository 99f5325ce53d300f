"""Rows that are kept on a tree in joint coordinates: those of joints that close loops, of drivers.

They are solved for with multipliers on the tree of the other joints (formulations/joint), as the
method joint does where a scene is no pure tree. equations.py has the order of the parts.
"""

from dap3d_core.formulations.joint.equations import accepted, watch
from dap3d_core.formulations.joint_loops.equations import project, report, rhs

__all__ = ["accepted", "project", "report", "rhs", "watch"]
