"""What a derived joint costs beside the hand-written one: J, gamma and nu of the standard joints.

Each standard joint whose rows all follow from C is examined once more with C alone. Both loops are
timed in turns over the same instances. The mark is 1.3 for the running time and 2 s for the
derivation, the import of sympy not counted (it is in the first row of a process without a cache).
"""

import os
import random
import tempfile
import time
from pathlib import Path

from kernels import CALLS, INSTANCES, RUNS, bodies, run
from timing import median_seconds

from dap3d_core.interface.examine.examine import examine
from dap3d_core.registry import load_registry

MARK, SECONDS = 1.3, 2.0


def derivable(registry):
    """(title, hand-written type) of the joints and variants that C determines."""
    for keyword in registry.keywords("joint"):
        type_info = registry.get("joint", keyword)
        for conditions, e in (({}, type_info), *type_info.variants):
            if "C" in e.kernels and not e.derived and all_of_position_level(e.type):
                words = ", ".join(f"{n} = {v}" for n, v in conditions.items())
                yield f"{keyword}{f' ({words})' if words else ''}", e


def all_of_position_level(type_):
    """Whether C gives every row."""
    return len(type_.position_rows()) == type_.rows


def from_C_alone(type_):
    """The same type without its own J, gamma and nu."""
    return type(f"Derived{type_.__name__}", (type_,), {"J": None, "gamma": None, "nu": None})


def derivation_seconds(type_):
    """Seconds to derive, write and load the kernels, with an empty cache."""
    from dap3d_core.kernels.runtime.cache import cache_folder

    before = os.environ.get("DAP3D_CACHE_DIR")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["DAP3D_CACHE_DIR"] = folder
        cache_folder.cache_clear()
        start = time.perf_counter()
        examine(from_C_alone(type_))
        seconds = time.perf_counter() - start
        assert list(Path(folder).glob("derived-*"))
    if before is None:
        del os.environ["DAP3D_CACHE_DIR"]
    else:
        os.environ["DAP3D_CACHE_DIR"] = before
    cache_folder.cache_clear()
    return seconds


def measure():
    """Rows of the table: joint, nanoseconds by hand and derived, ratio, seconds to derive."""
    rng, rows = random.Random(1), []
    body = bodies(rng)
    for title, by_hand in derivable(load_registry()):
        derived = examine(from_C_alone(by_hand.type))
        least = []
        functions = [run(e, "acceleration", body, rng) for e in (by_hand, derived)]
        times = [[median_seconds(pair, 1) for pair in functions] for _ in range(RUNS)]
        for column in zip(*times, strict=True):
            seconds, empty = (min(one) for one in zip(*column, strict=True))
            least.append((seconds - empty) / (CALLS * INSTANCES) * 1e9)
        seconds = derivation_seconds(by_hand.type)
        ratio = least[1] / least[0]
        in_mark = "yes" if ratio <= MARK and seconds <= SECONDS else "no"
        rows.append({"joint": title, "by_hand_ns": least[0], "derived_ns": least[1],
                     "ratio": ratio, "derivation_s": seconds,
                     "in_mark": in_mark})  # fmt: skip
    return rows
