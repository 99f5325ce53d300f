"""Optimisation in the background: units start with unoptimised code, which is then replaced.

A second process compiles the optimised code and writes it to the cache folder; calls poll for it
and load it. Each line of its standard input is a file of LLVM IR, a tab, the object file to write.
Without a second core or a cache folder, this process optimises once the unoptimised code has run
for as long as that takes.
"""

import atexit
import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.runtime.sealed_files import write_file

#: Seconds between two polls for optimised code.
POLL_INTERVAL = 0.02


class Optimiser:
    """Replaces the unoptimised code of units by optimised code.

    Attributes:
        units: those with unoptimised code.
    """

    def __init__(self) -> None:
        self.units: list[Any] = []
        self._lock = threading.Lock()
        self._process: Any = None
        self._polled = 0.0
        self._spent = 0.0
        self._is_held = False
        self._waiting: list[Any] = []

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Request nothing within, as of units that little is computed by; later, where they run."""
        before, self._is_held = self._is_held, True
        try:
            yield
        finally:
            self._is_held = before

    def add(self, unit: Any) -> None:
        """Request optimised code for a unit, from the second process where there can be one."""
        with self._lock:
            self.units.append(unit)
            self._waiting.append(unit)
        if not self._is_held:
            self._request_waiting()

    def _request_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        for unit in waiting:
            if unit.path is not None:
                self.request(unit.text, unit.results, unit.path)

    def request(self, text: str, results: list[Any], path: Path) -> bool:
        """Let the second process write optimised code of LLVM IR; False where there is none."""
        if not self.start():
            return False
        source = path.with_name(f"{path.stem}.{os.getpid()}.ll")
        if not write_file(source, objects.encoded(results, text.encode())):
            return False
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(f"{source}\t{path}\n".encode())
            self._process.stdin.flush()
            return True
        return False

    def _has_ended(self) -> bool:
        return self._process is not None and self._process.poll() is not None

    def start(self) -> bool:
        """Start the second process, which takes 0.2 s, unless it runs; False if there is none."""
        if core_count() < 2 or self._has_ended():
            return False
        if self._process is None:
            with contextlib.suppress(OSError):
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", __name__], stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
                )  # fmt: skip
                atexit.register(self._detach)
        return self._process is not None

    def _detach(self) -> None:
        """Let the second process finish its input after this process has ended."""
        self._process.stdin.close()
        self._process.returncode = 0  # nobody waits for it

    def poll(self, seconds: float) -> None:
        """Load optimised code that has become available.

        Args:
            seconds: run time of unoptimised code since the last call.
        """
        if self._is_held:
            return
        now = time.perf_counter()
        self._spent += seconds
        self._request_waiting()
        if now - self._polled < POLL_INTERVAL or not self._lock.acquire(blocking=False):
            return
        try:
            self._polled = now
            for unit in list(self.units):
                if unit.path is not None and (stored := objects.read_object(unit.path)):
                    self._replace(unit, stored[1])
            if self._process is None or self._has_ended():
                self._optimise_here()
        finally:
            self._lock.release()

    def _replace(self, unit: Any, code: bytes) -> None:
        unit.replace_code(code)
        self.units.remove(unit)

    def _optimise_here(self) -> None:
        if not self.units or self._spent < sum(unit.cost for unit in self.units):
            return
        for unit in list(self.units):
            self._replace(unit, objects.optimised(unit.text, unit.results, unit.path))
        self._spent = 0.0


optimiser = Optimiser()


def core_count() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def main() -> None:
    """Compile the requests on standard input until it ends."""
    if hasattr(os, "nice"):
        os.nice(5)
    for line in sys.stdin:
        path, target = map(Path, line.rstrip("\n").split("\t"))
        with contextlib.suppress(OSError, ValueError, RuntimeError):
            results, text = objects.decoded(path.read_bytes())
            if not target.exists():
                objects.optimised(text.decode(), results, target)
        with contextlib.suppress(OSError):
            path.unlink()


if __name__ == "__main__":
    main()
