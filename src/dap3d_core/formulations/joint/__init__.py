"""Joint formulation: trees of bodies in joint coordinates, by articulated inertias.

The motions that joints leave free come from their C and J alone (assembly/motion), so that types
need nothing for it. equations.py has the order of the parts.
"""

from dap3d_core.formulations.joint.equations import accepted, project, report, rhs, watch

__all__ = ["accepted", "project", "report", "rhs", "watch"]
