"""Progress of a run: a bar on a terminal, lines at growing intervals otherwise."""

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
)
from rich.text import Text

from dap3d_core.cli.console.console import Terminal, clean, seconds, stderr
from dap3d_core.cli.process.streams import is_quiet, prints_json

if TYPE_CHECKING:
    from dap3d_core.simulation import RunProgress

ONCE = "compiling for the first time; this happens once"
#: Time of the first line of progress, and the longest time between two lines, s.
FIRST_LINE, LONGEST_PAUSE = 1.0, 60.0
#: Time of the first line about work without progress, s.
SILENCE = 10.0
#: Columns of the spinner and a gap.
SPINNER_WIDTH = 2


class _Waiting:
    """Reports at growing intervals, from a thread, that work without progress continues."""

    def __init__(self, words: str, report: Callable[[str], None]) -> None:
        self._words, self._report = words, report
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name="dap3d-progress", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End the thread; nothing is printed after this call."""
        self._ended.set()
        self._thread.join()

    def _work(self) -> None:
        begin, pause = time.monotonic(), SILENCE
        while not self._ended.wait(pause):
            elapsed = time.monotonic() - begin
            self._report(f"{self._words}, for {seconds(elapsed)} so far")
            pause = min(elapsed, LONGEST_PAUSE)


class PreparationProgress:
    """Context manager that shows on stderr the preparation of a model.

    ``quiet``: shows nothing, as by default with --quiet and --json.
    """

    def __init__(self, *, quiet: bool | None = None) -> None:
        self._console: Terminal = stderr()
        self._quiet = is_quiet() or prints_json() if quiet is None else quiet
        self._task: Any = None
        self._announced = False
        self._waiting: _Waiting | None = None
        self._next_line = FIRST_LINE
        self._bar = None if self._quiet or not _is_live(self._console) else self._make_bar()

    def _make_bar(self) -> Progress:
        """The line on a terminal: a description in words."""
        columns = SpinnerColumn("line"), TextColumn("{task.description}", markup=False)
        return _transient(*columns, console=self._console)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
            self._task = self._bar.add_task("preparing", total=None)
        return self

    def __exit__(self, *failure: object) -> None:
        self._end_waiting()
        if self._bar is not None:
            self._bar.stop()

    def announce(self, kernel: str) -> None:
        """Show that a kernel is about to be compiled."""
        self._end_waiting()
        if not self._announced:
            self._announced = True
            self._print(ONCE)
        self._update(f"compiling {kernel}")
        if self._bar is None:
            self._print(f"  {kernel}")

    def start(self) -> None:
        """Show that the model is ready; its initial conditions are next."""
        self._update("starting")
        if self._bar is None and not self._quiet:
            self._waiting = _Waiting("finding the initial conditions", self._print)

    def _end_waiting(self) -> None:
        if self._waiting is not None:
            self._waiting.end()
            self._waiting = None

    @property
    def _width(self) -> int:
        return self._console.width - SPINNER_WIDTH

    def _update(self, words: str) -> None:
        """Describe the current work on the bar."""
        if self._bar is not None:
            self._bar.update(self._task, description=clean(words))

    def _print_at_times(self, words: str, elapsed: float) -> None:
        """Print a line of progress if the last one is long enough ago."""
        if elapsed >= self._next_line:
            self._print(words)
            self._next_line = elapsed + min(max(elapsed, FIRST_LINE), LONGEST_PAUSE)

    def _print(self, words: str) -> None:
        if not self._quiet:
            self._console.say(words)


class ProgressBar(PreparationProgress):
    """Shows the progress of a run."""

    _begin: tuple[float, float] | None = None
    _reached = 0.0

    def advance(self, run: "RunProgress") -> None:
        """Show a snapshot of the run."""
        self._end_waiting()
        now = time.monotonic()
        if self._begin is None or run.t < self._reached:  # a second run begins
            self._begin, self._next_line = (now, run.t), FIRST_LINE
        self._reached = run.t
        elapsed, simulated = now - self._begin[0], run.t - self._begin[1]
        rate = simulated / elapsed if elapsed > 0.0 else 0.0
        if self._bar is not None:
            self._update(live_line(run, rate, self._width))
        elif run.t < run.t_end:
            self._print_at_times(plain_line(run, rate), elapsed)


class PointsProgress(PreparationProgress):
    """Shows the progress of a study.

    Attributes:
        ran: points that were run by this command.
        elapsed: time for them in s.
    """

    _begin: tuple[float, int] | None = None
    ran, elapsed = 0, 0.0

    def count(self, done: int, total: int) -> None:
        """Show the number of points that are done."""
        now = time.monotonic()
        if self._begin is None:
            self._begin = (now, done)
        self.elapsed, self.ran = now - self._begin[0], done - self._begin[1]
        rate = self.ran / self.elapsed if self.elapsed > 0.0 else 0.0
        if self._bar is not None:
            self._update(points_line(done, total, rate, self._width))
        elif done < total:
            self._print_at_times(points_line(done, total, rate), self.elapsed)


def points_line(done: int, total: int, rate: float, width: int = 80) -> str:
    """Progress of a study in one line of a width; ``rate`` in points a second, 0 if not known."""
    percent, left = f"{done / total:4.0%}", f"{_left(total - done, rate)} left"
    now, pace = f"{done:{len(f'{total:,}')},}", f"{rate:.3g} points/s" if rate else "- points/s"
    return _longest(
        (
            f"{percent}  {now} of {total:,} points  {pace:>13}  {left}",
            f"{percent} {now}/{total:,} {pace} {left}",
            f"{percent} {pace} {left}",
            percent,
        ),
        width,
    )


def live_line(run: "RunProgress", rate: float, width: int) -> str:
    """Progress of a run in one line of a width; ``rate`` is 0 if it is not known yet.

    Numbers have fixed widths, so that the line does not jump.
    """
    percent, end = f"{run.t / run.t_end if run.t_end else 1.0:4.0%}", f"{run.t_end:.6g}"
    digits = max(0, 3 - math.floor(math.log10(run.t_end or 1.0)))
    now = f"{run.t:{len(f'{run.t_end:.{digits}f}')}.{digits}f}"
    pace = f"{rate:.3g}" if rate else "-"
    step, drift = f"{run.step:.1e}", f"drift {run.drift:.0e}"
    left = f"{_left(run.t_end - run.t, rate)} left"
    if not run.step:  # kinematics, maybe over an angle: nothing is integrated
        return _longest((f"{percent} {left}", percent[:width]), width)
    return _longest(
        (
            f"{percent}  t = {now} of {end} s  step {run.steps:,}: {step} s  {pace:>5}x real time  "
            f"{drift}  {left}",
            f"{percent} {now} of {end} s, step {step} s, {pace:>5}x real time, {drift}, {left}",
            f"{now}/{end} s step {step} {pace:>5}x {drift} {left}",
            f"{percent} {now}/{end} s {pace}x {drift} {left}",
            f"{percent} {left}",
            percent[:width],
        ),
        width,
    )


def plain_line(run: "RunProgress", rate: float) -> str:
    """The same for a file or another program."""
    left = seconds((run.t_end - run.t) / rate) if rate else "?"
    if not run.step:
        return f"{run.t / run.t_end:.0%}, about {left} left"
    return (
        f"t = {run.t:.4g} of {run.t_end:.4g} s ({run.t / run.t_end:.0%}), step {run.step:.2g} s, "
        f"{rate:.3g} x real time, energy drift {run.drift:.0e}, about {left} left"
    )


def _longest(forms: Sequence[str], width: int) -> str:
    """The first of several forms, from long to short, that fits; else the last one."""
    return next((form for form in forms if len(form) <= width), forms[-1])


def _left(amount: float, rate: float) -> str:
    """The time left for an amount of work, as h:mm:ss or m:ss."""
    if not rate:
        return "-:--"
    minutes, rest = divmod(math.ceil(amount / rate), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


@contextmanager
def counting(word: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on a terminal, unless quiet; yields a function of the number done and the total."""
    console = stderr()
    if is_quiet() or prints_json() or not _is_live(console):
        yield lambda done, total: None
        return
    with bar_of(console) as bar:
        task = bar.add_task("preparing", total=None)
        yield lambda done, total: bar.update(
            task, total=total, completed=done, description=f"{word} {done:,} of {total:,}"
        )


def _is_live(console: Terminal) -> bool:
    """True on a terminal that can redraw a line."""
    return console.file.isatty() and not console.is_dumb_terminal


class _Left(ProgressColumn):
    """The estimated time left; empty while there is no estimate."""

    def render(self, task: Task) -> Text:
        left = task.time_remaining
        known = left is not None and task.total is not None and not task.finished
        return Text(f"{seconds(left or 0.0)} left" if known else "")


def bar_of(console: Terminal) -> Progress:
    """Spinner, description, bar, percentage, estimate, in 60 columns."""
    columns: list[Any] = [SpinnerColumn("line"), TextColumn("{task.description}", markup=False)]
    if console.width >= 50:
        columns.append(BarColumn(bar_width=14 if console.width < 72 else 24))
    return _transient(*columns, TaskProgressColumn(), _Left(), console=console)


def _transient(*columns: Any, console: Terminal) -> Progress:
    """Progress that is erased from the screen at its end."""
    return Progress(*columns, console=console, transient=True, refresh_per_second=8)
