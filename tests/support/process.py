"""Python scripts run in fresh processes, with a cache folder of their own or that of the tests.

And jobs that threads do at once.
"""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
#: Where tests keep code (tests/conftest.py).
UNOPTIMISED = REPOSITORY / "build" / "unoptimised"
#: Where ``sitecustomize`` keeps child processes from optimising code beside.
ONE_CORE = REPOSITORY / "tests" / "support" / "one_core"


def environment(cache=UNOPTIMISED, **variables):
    """The environment of a child process, with a cache of compiled code, for the same processor.
    With that of the tests its code stays unoptimised, as theirs does."""
    ours = ("DAP3D_", "COVERAGE_")
    env = {k: v for k, v in os.environ.items() if not k.startswith(ours) or k == "DAP3D_CPU"}
    if cache == UNOPTIMISED and "DAP3D_PLAIN" not in variables:
        env["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ONE_CORE), env.get("PYTHONPATH")]))
    return env | {"DAP3D_CACHE_DIR": str(cache)} | {k: str(v) for k, v in variables.items()}


def start(script, cache=UNOPTIMISED, *, cwd=None, **variables):
    """Start a script and return the process."""
    return subprocess.Popen(
        [sys.executable, "-c", script],
        env=environment(cache, **variables),
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(script, cache=UNOPTIMISED, *, cwd=None, timeout=300, **variables):
    """Run a script to its end and return what it printed; its failure is the test's."""
    process = start(script, cache, cwd=cwd, **variables)
    out, err = process.communicate(timeout=timeout)
    assert process.returncode == 0, err
    return out.strip()


def together(*jobs):
    """Do jobs in threads at once; what each returned, or the error of the first that failed."""
    barrier = threading.Barrier(len(jobs))

    def work(job):
        barrier.wait()
        return job()

    with ThreadPoolExecutor(len(jobs)) as pool:
        return list(pool.map(work, jobs))
