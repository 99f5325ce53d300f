"""What sweeps print: how failed points ended."""

from dap3d_core.cli.console.console import stdout
from dap3d_core.cli.console.sweep_tables import show_failing


def test_a_point_says_once_how_it_ended(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    failing = [
        {"at": {"k": 1.0}, "status": "stopped", "note": "the run stopped at t = 1 s: singular"},
        {"at": {"k": 2.0}, "status": "failed", "note": "a mass is greater than 0"},
    ]
    show_failing(stdout(), {"failing": failing, "stopped": 1, "failed": 1, "points": 9}, "")
    told = capsys.readouterr().out
    assert "k = 1: the run stopped at t = 1 s: singular" in told
    assert "k = 2: failed: a mass is greater than 0" in told
