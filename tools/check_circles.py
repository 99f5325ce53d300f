"""Check that no files of src and plugins import each other in a circle.

Imports within functions and for type checkers count as well: a file can be read, and changed, with
those below it in mind alone.

    python tools/check_circles.py

Prints the first circle, as its files; exits with 1 if there is one.
"""

import sys
from graphlib import CycleError, TopologicalSorter

import grimp

PACKAGES = (
    "dap3d_core", "dap3d_joints", "dap3d_forces", "dap3d_functions", "dap3d_formats",
    "dap3d_matlab", "dap3d_results",
)  # fmt: skip
#: Packages offer what is in their files, and their files may name them.
OFFERING = ("dap3d_core", "dap3d_core.interface", "dap3d_core.kernels")


def imports() -> dict[str, set[str]]:
    """The files that each file imports."""
    graph = grimp.build_graph(*PACKAGES, include_external_packages=False, cache_dir=None)
    files = graph.modules - set(OFFERING)
    return {file: graph.find_modules_directly_imported_by(file) & files for file in sorted(files)}


def main() -> int:
    """Print a circle; 1 if there is one."""
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as error:
        print("circle: " + " <- ".join(error.args[1]))
        return 1
    print("circles: none")
    return 0


if __name__ == "__main__":
    sys.exit(main())
