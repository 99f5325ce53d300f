"""Scenes that a script writes are what the script writes."""

import subprocess
import sys
from pathlib import Path

import pytest

import dap3d_core as dap

SCRIPT = Path(__file__).parents[2] / "tools" / "scene_of_fourbars.py"


def written(*arguments):
    """What the script does when it is called."""
    call = [sys.executable, SCRIPT, *arguments]
    return subprocess.run(call, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("n", [1, 2, 40])
def test_the_scene_of_a_row_of_fourbars(n):
    """The committed scene equals the output of the script, byte for byte."""
    folder = dap.shipped_models()[f"A02-{n}"]
    done = written(str(n))
    assert done.returncode == 0, done.stderr
    assert done.stdout == (folder / "scene.toml").read_text()


@pytest.mark.parametrize("arguments", [(), ("0",), ("two",), ("1", "2"), ("-1",)])
def test_the_script_says_what_it_needs(arguments):
    """Anything but one whole number above zero is refused with one line."""
    done = written(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("usage: ")
    assert done.stderr.count("\n") == 1
