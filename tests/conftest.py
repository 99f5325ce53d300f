"""What all tests rely on."""

import gc
import os
import signal
from collections import Counter

import pytest

# Tests fill all cores by themselves, and their matrices are small: threads of BLAS would only wait,
# each at the cost of a core. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that puts a command into the background lets it ignore Ctrl-C, and so its children.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    """Quick tests have ended before optimised code is there: none is made beside them, as for
    threads of BLAS, and none is asked for, which is hundreds of files fifty times a second."""
    gc.disable()  # nothing that is imported or collected is garbage
    if "not slow" in session.config.option.markexpr:
        from dap3d_core.kernels.compiler import background

        background.optimiser.add = lambda unit: None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of the cases of a verification the quick tests take the first, of `every(n)` each n-th."""
    counts = Counter()
    for item in items:
        mark = item.get_closest_marker("every")
        is_swept = mark or "/verification/" in item.path.as_posix()
        if not is_swept or item.get_closest_marker("slow"):
            continue
        test = item.nodeid.partition("[")[0]
        count, counts[test] = counts[test], counts[test] + 1
        if count % mark.args[0] if mark else count:
            item.add_marker("slow")


def pytest_collection_finish():
    """Thousands of tests are no garbage: each collection would go through them again."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def cache_of_libraries(tmp_path_factory):
    """A folder for unoptimised objects: those of users are optimised."""
    return tmp_path_factory.mktemp("libraries")


@pytest.fixture
def quick_libraries(monkeypatch, cache_of_libraries):
    """Export unoptimised code, which has the same bits and is made in a hundredth of the time."""
    from dap3d_core.kernels.compiler.objects import UNOPTIMISED
    from dap3d_core.native import build

    monkeypatch.setattr(build, "OPTIMISED", UNOPTIMISED)
    monkeypatch.setattr(build, "cache_folder", lambda: cache_of_libraries)
