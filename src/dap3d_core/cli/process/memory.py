"""The limit on the memory of the process, checked before libraries that end it for a lack."""

import mmap
import os

#: Address space, bytes, that numpy's import takes, and what each of its threads adds. With less
#: its library ends the process with a message of its own, or interrupts it.
NUMPY, THREAD = 160 * 2**20, 40 * 2**20
#: With less left, libraries fail for a lack of memory in words of their own, such as "HDF error".
LEAST = 16 * 2**20


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
    if not _has_room(NUMPY + THREAD * (os.cpu_count() or 1)):
        raise MemoryError


def is_used_up() -> bool:
    """True if the limit on the address space leaves so little that libraries fail."""
    return not _has_room(LEAST)


def _has_room(size: int) -> bool:
    """True if the limit on the address space, if there is one, leaves a number of bytes."""
    if address_space() is None:
        return True
    try:
        mmap.mmap(-1, size).close()
    except OSError:
        return False
    return True
