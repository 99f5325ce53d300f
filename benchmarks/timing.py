"""How things are timed here: medians of interleaved runs."""

import statistics
import time

from dap3d_core.kernels.compiler.background import optimiser


def median_seconds(functions, repeats=7):
    """Median seconds of each function.

    They are called in turn (A B A B ...), so that drift of the machine hits all alike.
    """
    found = [[] for _ in functions]
    for function in functions:
        function()
    wait_for_good_code()
    for _ in range(repeats):
        for times, function in zip(found, functions, strict=True):
            start = time.perf_counter()
            function()
            times.append(time.perf_counter() - start)
    return [statistics.median(times) for times in found]


def wait_for_good_code():
    """Wait until what was compiled quickly has been compiled well."""
    while optimiser.units:
        time.sleep(0.05)
        optimiser.poll(0.0)
