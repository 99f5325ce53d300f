"""What a run shows while it works: one line on a terminal, now and then a line elsewhere."""

import pytest

from dap3d_core.cli.console import progress
from dap3d_core.simulation import RunProgress


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def standing(t, t_end=100.0):
    return RunProgress(t=t, t_end=t_end, steps=int(10 * t), step=0.1, drift=2e-9)


def test_lines_come_ever_more_rarely_and_estimate_what_is_left(clock, capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)  # lines are as long as they are
    with progress.ProgressBar(quiet=False) as shown:
        for k in range(101):
            clock[0] = float(k)
            shown.advance(standing(0.5 * k))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == (
        "t = 0.5 of 100 s (0%), step 0.1 s, 0.5 x real time, energy drift 2e-09, "
        "about 3 min 19 s left"
    )
    assert len(lines) == 7  # after 1, 2, 4, 8, ... s
    assert lines[-1].startswith("t = 32 of 100 s (32%), ")
    assert lines[-1].endswith(", about 2 min 16 s left")


def test_compilation_is_announced_once_with_its_names(capsys):
    with progress.ProgressBar(quiet=False) as shown:
        shown.announce("sph: C")
        shown.announce("rev: C")
    assert capsys.readouterr().err.splitlines() == [progress.ONCE, "  sph: C", "  rev: C"]


def test_quiet_is_quiet(clock, capsys):
    with progress.ProgressBar(quiet=True) as shown:
        shown.announce("sph: C")
        shown.start()
        for k in range(100):
            clock[0] = float(k)
            shown.advance(standing(float(k)))
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("width", [58, 108])
@pytest.mark.parametrize(("t_end", "rate"), [(0.05, 0.00123), (1.0, 12.0), (100.0, 345.0)])
def test_the_live_line_says_everything_from_60_columns_on(width, t_end, rate):
    """Time, step, pace, drift and what is left, whenever that is less than an hour."""
    run = standing(0.37 * t_end, t_end)
    line = progress.live_line(run, rate, width)
    assert len(line) <= width
    left = 0.63 * t_end / rate
    if left < 3599.0:
        for words in (f"{t_end:g} s", "1.0e-01", f"{rate:.3g}x", "drift 2e-09", " left"):
            assert words in line, (words, line)


def test_the_live_line_keeps_its_width_and_fits_any_terminal():
    lines = [
        progress.live_line(standing(t, 20.0), 5.0 + 0.01 * t, 77)
        for t in (0.1, 3.0, 9.99, 15.0, 19.9)
    ]
    assert len({len(line) for line in lines}) == 1
    for width in range(4, 60):
        assert len(progress.live_line(standing(37.0), 0.01, width)) <= width
    assert "about ? left" in progress.plain_line(standing(0.1), 0.0)  # before the pace is known


def test_kinematics_has_neither_steps_nor_drift():
    """Over a driver's coordinate it has no time either: what is done and left is all there is."""
    run = RunProgress(t=1.5, t_end=6.0, steps=0, step=0.0, drift=0.0)
    assert progress.plain_line(run, 0.5) == "25%, about 9 s left"
    assert progress.live_line(run, 0.5, 77) == " 25% 0:09 left"
    assert progress.live_line(run, 0.5, 4) == " 25%"


@pytest.mark.parametrize(
    ("rate", "words"), [(0.0, "-:-- left"), (1.0, "1:03 left"), (0.01, "1:45:00 left")]
)
def test_what_is_left_is_shown_as_by_a_clock(rate, words):
    assert progress.live_line(standing(37.0), rate, 107).endswith(words)


def test_points_are_counted_with_their_rate_and_what_is_left(clock, capsys, monkeypatch):
    """A sweep that goes on has some points already: they are none of its pace."""
    monkeypatch.delenv("COLUMNS", raising=False)
    with progress.PointsProgress(quiet=False) as shown:
        for k in range(51):
            clock[0] = float(k)
            shown.count(500 + 10 * k, 1000)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == " 51%    510 of 1,000 points    10 points/s  0:49 left"
    assert len(lines) == 6  # after 1, 2, 4, 8, ... s
    assert (shown.ran, shown.elapsed) == (500, 50.0)


@pytest.mark.parametrize("width", [20, 40, 58])
@pytest.mark.parametrize(("total", "rate"), [(3, 0.0), (1000, 5.0), (10**8, 0.0123)])
def test_the_line_of_points_fits(width, total, rate):
    """Its parts all stand from 58 columns on, but where a hundred million take weeks."""
    words = progress.points_line(total // 3, total, rate, width)
    assert len(words) <= width
    assert words.startswith(" 33%")
    if width >= 58 and rate != 0.0123:
        assert f" of {total:,} points" in words or f"/{total:,} " in words
        assert words.endswith("left")


def test_a_long_correction_says_that_it_goes_on(capfd, monkeypatch):
    """Elsewhere than on a terminal, until the run tells of itself: no command hangs wordless."""
    monkeypatch.setattr(progress, "SILENCE", 0.01)
    with progress.ProgressBar(quiet=False) as shown:
        shown.start()
        said = ""
        while said.count("\n") < 2:  # ends as soon as the second line is there
            said += capfd.readouterr().err
        shown.advance(standing(0.0))
        capfd.readouterr()
        assert shown._waiting is None
    assert said.startswith("finding the initial conditions, for ")
    assert capfd.readouterr().err == ""


def test_a_run_that_cannot_leave_its_start_is_told_of(clock, capsys):
    """Steps that are rejected again and again at t = 0 are work without an end, too."""
    with progress.ProgressBar(quiet=False) as shown:
        for k in range(5):
            clock[0] = float(k)
            shown.advance(standing(0.0))
    assert capsys.readouterr().err.startswith("t = 0 of 100 s (0%), ")
