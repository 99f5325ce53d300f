"""The comparison with other programs: its driver of dap3d works, its page says what is stored."""

import importlib.util
import json
import subprocess
import sys

import pytest
from support.process import REPOSITORY, environment

PEERS = REPOSITORY / "benchmarks" / "peers"


@pytest.fixture
def beside(monkeypatch):
    """Modules of benchmarks/peers by name."""
    monkeypatch.syspath_prepend(str(PEERS))
    before = set(sys.modules)

    def load(name):
        return importlib.import_module(name)

    yield load
    for name in set(sys.modules) - before:
        if str(PEERS) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.mark.slow
def test_the_driver_of_dap3d_reaches_all_levels(tmp_path):
    """One rod, one scene: two passes, errors down to 1e-9; a run that was stopped goes on."""
    output = tmp_path / "out.json"
    command = [sys.executable, str(PEERS / "run.py"), "-o", str(output), "--passes", "2",
               "--programs", "dap3d", "--scenes", "spherical-chain-1"]  # fmt: skip
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "spherical-chain-1" in done.stdout
    cells = json.loads(output.read_text())["cells"]
    assert min(c["error"] for c in cells if c.get("error") is not None) < 1e-9
    assert max(len(c["seconds"]) for c in cells) == 2
    assert all(s > 0.0 for c in cells for s in c["seconds"])


def test_references_are_of_these_scenes(beside):
    """Every scene has one, as many positions as bodies, known far below the finest level."""
    references, scenes = beside("references").load(), list(beside("mechanisms").all_mechanisms())
    assert set(references) == {m.key for m in scenes}
    for mechanism in scenes:
        reference = references[mechanism.key]
        numbers = 9 if mechanism.name == "free-body" else 3 * len(mechanism.bodies)
        assert len(reference["R" if mechanism.name == "free-body" else "x"]) == numbers
        assert reference["uncertainty"] < 5e-10


def test_times_are_interpolated_between_settings(beside):
    """On the line through two settings in logarithms; no further than measured."""
    levels = beside("levels")
    common = {"scene": "s-1", "program": "dap3d", "method": "m", "steps": 1}
    cells = [common | {"parameter": p, "error": e, "seconds": [9.0, t, 0.0]}
             for p, e, t in ((1, 1e-4, 1.0), (2, 1e-8, 4.0))]  # fmt: skip
    assert levels.best(cells, "s-1", "dap3d", 1e-6)[0] == pytest.approx(2.0)
    assert levels.best(cells, "s-1", "dap3d", 1e-3) == (1.0, "m")
    assert levels.best(cells, "s-1", "dap3d", 1e-9)[0] == float("inf")
    lost = common | {"parameter": 3, "error": 1.2, "seconds": [8.0]}
    assert levels.best([*cells, lost], "s-1", "dap3d", 1e-6)[0] == float("inf")


def test_the_page_says_what_is_stored(beside):
    """The tables of docs/reference/peers.md are those that its command makes of stored results."""
    document = beside("document")
    data = json.loads((PEERS / "results.json").read_text())
    text = document.PAGE.read_text()
    assert document.filled(text, data) == text
    for name in document.PARTS:
        assert f"<!-- {name} -->\n|" in text or f"<!-- {name} -->\nAll" in text


@pytest.mark.slow
def test_the_benchmarks_start():
    """``benchmarks/run.py --help`` imports all of them."""
    program = [sys.executable, str(REPOSITORY / "benchmarks" / "run.py"), "--help"]
    done = subprocess.run(program, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "--only" in done.stdout
