"""The benchmarks start: a change of what they import is noticed before someone measures."""

import subprocess
import sys

import pytest
from support.process import REPOSITORY, environment


@pytest.mark.slow
def test_the_benchmarks_start():
    """``benchmarks/run.py --help`` imports all of them."""
    program = [sys.executable, str(REPOSITORY / "benchmarks" / "run.py"), "--help"]
    done = subprocess.run(program, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "--only" in done.stdout
