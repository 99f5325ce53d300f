"""What all tests rely on."""

import gc
import os
import signal
from collections import defaultdict
from inspect import isfunction
from math import ceil
from zlib import crc32

import pytest
from support.process import UNOPTIMISED

# Tests fill all cores by themselves, and their matrices are small: threads of BLAS would only wait,
# each at the cost of a core. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that puts a command into the background lets it ignore Ctrl-C, and so its children.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

#: Slow cases of one test that CI verifies, about; the others are long.
MOST_CASES = 4
#: Folders whose slow cases CI all verifies: commands, and numbers of shipped models.
WHOLE = ("e2e", "models")


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    gc.disable()  # nothing that is imported or collected is garbage
    if session.config.option.markexpr != "long":
        keep_unoptimised()


def keep_unoptimised():
    """Let code stay unoptimised, which has the same bits, and keep it: most tests have ended before
    optimised code is there, which takes longer to make than all of them. Where the user's cache has
    some, it is used. Optimised code is tested in unit/kernels/compiler."""
    from dap3d_core.kernels.compiler import background, objects, units
    from dap3d_core.kernels.runtime.cache import cache_folder

    compile_unit, optimised, users = units.Unit._compile, objects.optimised, cache_folder()

    def is_users(path):
        return path is not None and path.parent == users

    def compile_once(unit, write, ready_name):
        if not is_users(unit.path):
            return compile_unit(unit, write, ready_name)
        path, unit.is_optimised = UNOPTIMISED / unit.path.name, False
        kept = objects.read_object(path)
        if kept is None:
            kept = compile_unit(unit, write, ready_name)
            UNOPTIMISED.mkdir(0o700, parents=True, exist_ok=True)
            objects.write_object(path, *kept)
        return kept

    def compile_program(text, results, path):
        if is_users(path):
            return objects.compile_ir(text, objects.UNOPTIMISED)
        return optimised(text, results, path)

    units.Unit._compile, objects.optimised = compile_once, compile_program
    background.optimiser.add = lambda unit: None


def pytest_pycollect_makeitem(collector, obj):
    """Make no items of slow tests that are left out: their thousands of cases take seconds."""
    if collector.config.option.markexpr != "not slow" or not isfunction(obj):
        return None
    marks = (*getattr(obj, "pytestmark", ()), *collector.iter_markers())
    return [] if any(mark.name == "slow" for mark in marks) else None


def _families(items):
    """Cases of one test each, in order."""
    found = defaultdict(list)
    for item in items:
        found[item.nodeid.partition("[")[0]].append(item)
    return found.values()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of the cases of a verification the quick tests take the first, of `every(n)` each n-th, of
    any other test that has more than three some three. Of those that they leave CI verifies some
    `MOST_CASES`, without order: each n-th would have the same value of some parameter. Examples of
    the documents are all run."""
    for found in _families(i for i in items if not i.get_closest_marker("slow")):
        mark = found[0].get_closest_marker("every")
        if mark:
            n = mark.args[0]
        elif "/verification/" in found[0].path.as_posix():
            n = len(found)
        else:
            n = max(3, ceil(len(found) / 3)) if len(found) > 3 else 1
        for k, item in enumerate(found):
            if k % n:
                item.add_marker("slow")
    for found in _families(i for i in items if i.get_closest_marker("slow")):
        n = 1 if found[0].path.parent.name in WHOLE else ceil(len(found) / MOST_CASES)
        for item in found:
            if crc32(item.nodeid.encode()) % n:
                item.add_marker("long")


def pytest_collection_finish():
    """Thousands of tests are no garbage: each collection would go through them again."""
    gc.freeze()
    gc.set_threshold(10_000, *gc.get_threshold()[1:])
    gc.enable()


@pytest.fixture(scope="session")
def cache_of_libraries(tmp_path_factory):
    """A folder for unoptimised objects: those of users are optimised."""
    return tmp_path_factory.mktemp("libraries")


@pytest.fixture
def quick_libraries(monkeypatch, cache_of_libraries):
    """Export unoptimised code, which has the same bits and is made in a hundredth of the time."""
    monkeypatch.setattr("dap3d_core.native.build.OPTIMISED", 0)
    monkeypatch.setattr("dap3d_core.native.build.cache_folder", lambda: cache_of_libraries)
