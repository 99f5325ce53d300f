"""The view layer: a result as one page with a three-dimensional scene, plots and the ledger."""

from dap3d_core.registry.arguments import make_callable
from dap3d_core.view.page import View, view

__all__ = ["View", "view"]

make_callable(__name__, view)
