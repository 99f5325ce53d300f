"""What a second core could gain at most: one chain of n bodies against two of n/2 at once.

Two threads that share nothing but memory. Each one's processor time tells what memory costs them,
also on a machine whose cores are in use; wall time tells more where two cores are free.
"""

import statistics
import threading
import time

import numpy as np
import scenes

from dap3d_core.simulation import CompiledModel

SIZES = (1000, 10_000, 100_000)
#: Bodies that one timing evaluates; timings.
WORK, REPEATS = 20_000, 25


def evaluated(n):
    """A function that evaluates the right-hand side of a chain so many times."""
    machine = CompiledModel(scenes.chain(n)).machine
    y = machine.integrated(machine.model.u0)
    out = np.zeros_like(y)

    def run(count):
        for _ in range(count):
            machine.functions[0](0.0, y, out, machine.system, machine.loops)

    return run


def timed(functions, count):
    """Processor seconds of the slowest of the functions, each in a thread; and wall seconds."""
    seconds = [0.0] * len(functions)

    def run(k):
        start = time.thread_time()
        functions[k](count)
        seconds[k] = time.thread_time() - start

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(functions))]
    start = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return max(seconds), time.perf_counter() - start


def measure():
    """Rows of the table: bodies, bounds of the gain by processor time and by wall time."""
    rows = []
    for n in SIZES:
        one, halves = evaluated(n), [evaluated(n // 2), evaluated(n // 2)]
        count = max(1, WORK // n)
        timed([one], 1)
        timed(halves, 1)
        pairs = [(timed([one], count), timed(halves, count)) for _ in range(REPEATS)]
        bounds = [statistics.median(a[k] / b[k] for a, b in pairs) for k in range(2)]
        rows.append({"bodies": n, "bound_processor": bounds[0], "bound_wall": bounds[1]})
    return rows
