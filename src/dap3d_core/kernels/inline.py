"""Plain Python functions that compiled code may call: they stay plain for everyone else."""

from numba.extending import register_jitable

#: As compiled code that calls them: IEEE division (no exception on 1/0), fused multiply-add,
#: nothing reassociated.
INLINE_OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}

_known: set = set()


def inlined(function):
    """Let compiled code call this function; from Python it stays what it is."""
    if function not in _known:
        _known.add(function)
        register_jitable(**INLINE_OPTIONS)(function)
    return function
