"""The corrected initial conditions in words: all of a few bodies, the largest changes of many."""

import numpy as np
import pytest
from support.internals import join

from dap3d_core.cli.console.console import stdout
from dap3d_core.cli.console.run_summary import (
    MOST_BODIES,
    MOST_EVENTS,
    MOST_OF_FILE,
    correction_data,
    show_correction,
    show_details,
)


def corrected(shifts):
    """The facts of bodies at rest, body k moved by shifts[k] m along x."""
    n = len(shifts)
    zero, p = np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    moved = zero.copy()
    moved[:, 0] = shifts
    names = [f"link{k}" for k in range(n)]
    return correction_data(names, join(zero, p, zero, zero), join(moved, p, zero, zero))


@pytest.fixture
def printed(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)

    def show(initial):
        show_correction(stdout(), initial)
        return capsys.readouterr().out

    return show


def test_a_few_bodies_are_all_printed(printed):
    initial = corrected([0.1, 0.0, 0.3])
    assert initial["changed_bodies"] == ["link0", "link2"]
    text = printed(initial)
    assert "link0" in text
    assert "link2" in text
    assert "link1" not in text
    assert "more" not in text


def test_of_many_bodies_those_that_were_changed_most_are_printed(printed):
    """50 bodies filled 100 lines, and more of the screen than the run."""
    shifts = 1e-3 * np.random.default_rng(1).permutation(np.arange(1, 51))
    initial = corrected(shifts)
    text = printed(initial)
    largest = {f"link{k}" for k in np.argsort(-shifts)[:MOST_BODIES]}
    assert {line.strip() for line in text.splitlines() if line.startswith("  link")} == largest
    assert "and 45 bodies more, changed less; --json prints all" in text
    assert len(text.splitlines()) < 40
    assert len(initial["changed_bodies"]) == len(initial["bodies"]) == 50


def test_after_a_run_a_few_events_are_printed_and_of_a_file_many(capsys):
    events = [{"text": f"t = {k} s: lift of floor"} for k in range(10)]
    data = {"events": events, "ledger": {}, "notes": [], "method": "lsq"}
    show_details(stdout(), data)
    text = capsys.readouterr().out
    assert text.count("lift") == MOST_EVENTS
    assert "and 4 more, which dap3d info lists" in text
    show_details(stdout(), data, MOST_OF_FILE)
    assert capsys.readouterr().out.count("lift") == 10
