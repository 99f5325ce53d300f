"""Integers in memory that two threads read and write at once, and how compiled code waits.

Each is a word of an int64 array. In plain Python, where no second thread works, they are what they
look like.
"""

import os
from typing import Any

from dap3d_core.kernels.compiler.words import word

#: Words between two that different threads write: two lines of the cache, which comes in pairs.
APART = 16


@word("load")
def load(array: Any, k: int) -> int:
    """The word as it is; what its writer did before is seen after it."""
    return int(array[k])


@word("store")
def store(array: Any, k: int, value: int) -> None:
    """Write a word, after all that was written before."""
    array[k] = value


@word("replace")
def replace(array: Any, k: int, old: int, new: int) -> bool:
    """Write ``new`` where ``old`` stands, in one go; False where something else stood there."""
    if array[k] != old:
        return False
    array[k] = new
    return True


@word("pause")
def pause() -> None:
    """A moment's wait in a loop that looks at a word."""


@word("give_way")
def give_way() -> None:
    """Let another thread have this core, if one wants it."""
    os.sched_yield()


@word("address_of")
def address_of(array: Any) -> int:
    """Where the first number of an array stands."""
    return int(array.ctypes.data)


@word("vector_at")
def vector_at(address: int, size: int) -> Any:
    """The numbers at an address, as an array whose owner is somewhere else; compiled code only."""
    raise NotImplementedError("in plain Python arrays are handed on themselves")
