"""What all tests rely on."""

import gc
import os
import signal

import pytest

# Tests fill all cores by themselves, and their matrices are small: threads of BLAS would only wait,
# each at the cost of a core. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that puts a command into the background lets it ignore Ctrl-C, and so its children.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    """As for threads of BLAS, no core is left for a second process that optimises code.

    Slow tests need that code; quick ones have ended before it is there.
    """
    if "not slow" in session.config.option.markexpr:
        from dap3d_core.kernels.compiler import background

        background.core_count = lambda: 1


def pytest_collection_finish():
    """Thousands of tests are no garbage: each collection would go through them again."""
    gc.collect()
    gc.freeze()
