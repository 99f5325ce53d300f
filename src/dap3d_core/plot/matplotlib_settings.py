"""Imports matplotlib with the user's settings, not with those of the current folder.

A ``matplotlibrc`` there may be that of a stranger's model, and may have names read as TeX.
"""

import os
import sys

#: The settings file that matplotlib looks for in the current folder first, as it is imported.
_FILE = "matplotlibrc"


def import_matplotlib() -> None:
    """Import matplotlib; a script that has imported it before has decided by itself."""
    if "matplotlib" in sys.modules or not os.path.lexists(_FILE):
        return
    here = os.getcwd()
    os.chdir(os.path.abspath(os.sep))
    try:
        import matplotlib  # noqa: F401
    finally:
        os.chdir(here)


import_matplotlib()
