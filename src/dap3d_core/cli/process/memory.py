"""The limit on the memory of the process, checked before libraries that end it for a lack."""

import mmap
import os

#: Address space, bytes, that numpy's import takes, and what each of its threads adds. With less
#: its library ends the process with a message of its own, or interrupts it.
NUMPY, THREAD = 160 * 2**20, 40 * 2**20


def address_space() -> int | None:
    """The limit on the address space of the process, bytes; None without one."""
    try:
        import resource
    except ImportError:  # not on every system
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def check_memory() -> None:
    """Check that numpy can be imported.

    Raises:
        MemoryError: the limit on the address space leaves too little for it.
    """
    if address_space() is None:
        return
    try:
        mmap.mmap(-1, NUMPY + THREAD * (os.cpu_count() or 1)).close()
    except OSError as error:
        raise MemoryError from error
