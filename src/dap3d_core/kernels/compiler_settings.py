"""Imports numba so that neither the current folder nor a broken variable decides what it does.

numba reads a settings file of the current folder, which may be that of a stranger's model, as it is
imported and again as it compiles; a variable that it cannot read it reports with a traceback.
"""

import os
import re
import sys
import warnings

#: The settings file, looked for in the current folder.
_FILE = ".numba_config.yaml"
_UNREADABLE = re.compile(
    r"Environment variable '(\w+)' is defined but its associated value '(.*?)'"
)


def import_numba() -> None:
    """Import numba, with its defaults and the environment's settings alone.

    A script that has imported it before has decided by itself.
    """
    if "numba" in sys.modules:
        return
    here = os.getcwd() if os.path.lexists(_FILE) else None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if here is not None:
            os.chdir(os.path.abspath(os.sep))
        try:
            from numba.core import config
        finally:
            if here is not None:
                os.chdir(here)
    config._config_fname = os.devnull  # no regular file, so it is not read again
    for each in caught:
        _report(each)


def _report(warning: warnings.WarningMessage) -> None:
    """Pass a warning of the import on; that of a variable in one sentence."""
    if variable := _UNREADABLE.match(str(warning.message)):
        name, value = variable.groups()
        words = f"the environment variable {name} is ignored: numba cannot read its value {value!r}"
        warnings.warn(words, RuntimeWarning, stacklevel=1)
    else:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)


import_numba()
