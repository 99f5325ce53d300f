"""A process beside this one that compiles a part of the driver.

In an empty cache the driver takes most of a minute, and numba compiles in one thread. Parts that
need nothing of each other are compiled in two processes, which share the cache alone: what one has
left there the other loads.
"""

import atexit
import os
import subprocess
import sys

from dap3d_core.kernels.cache import cache_folder, jit_is_on

_running: list[subprocess.Popen[bytes]] = []


def compile_beside(module: str) -> None:
    """Run a module that compiles, where a second core is there for it.

    It ends with this process at the latest.
    """
    folder = cache_folder()
    if not jit_is_on() or folder is None or _running or _cores() < 2:
        return
    command = [sys.executable, "-P", "-m", module]
    nothing = subprocess.DEVNULL
    environment = os.environ | {"DAP3D_CACHE_DIR": str(folder)}
    try:
        process = subprocess.Popen(
            command, env=environment, stdin=nothing, stdout=nothing, stderr=nothing
        )
    except OSError:
        return
    atexit.register(process.terminate)
    _running.append(process)


def wait_for_what_is_beside() -> None:
    """Wait until it is done. Whatever became of it: what it did not compile is compiled here."""
    while _running:
        process = _running.pop()
        process.wait()
        atexit.unregister(process.terminate)


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
