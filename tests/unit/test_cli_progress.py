"""Progress where nobody looks at a terminal: a line now and then, on stderr."""

import pytest

from dap3d_core.cli import progress
from dap3d_core.cli.progress import ONCE, RunProgress


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_lines_come_ever_more_rarely_and_estimate_what_is_left(clock, capsys):
    with RunProgress(quiet=False) as shown:
        for k in range(101):
            clock[0] = float(k)
            shown.advance(0.5 * k, 100.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "t = 0.5 of 100 s (0%), about 3 min 19 s left"
    assert len(lines) == 7  # after 1, 2, 4, 8, ... s
    assert lines[-1] == "t = 32 of 100 s (32%), about 2 min 16 s left"


def test_compilation_is_announced_once_with_its_names(capsys):
    with RunProgress(quiet=False) as shown:
        shown.announce("sph: C")
        shown.announce("rev: C")
    assert capsys.readouterr().err.splitlines() == [ONCE, "  sph: C", "  rev: C"]


def test_quiet_is_quiet(clock, capsys):
    with RunProgress(quiet=True) as shown:
        shown.announce("sph: C")
        shown.start()
        for k in range(100):
            clock[0] = float(k)
            shown.advance(float(k), 100.0)
    assert capsys.readouterr() == ("", "")
