"""What a run shows while it works: a bar on a terminal, now and then a line elsewhere."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TaskProgressColumn, TextColumn
from rich.text import Text

from dap3d_core.cli.console.console import Terminal, clean, messages, say, seconds

if TYPE_CHECKING:
    from dap3d_core.simulation import Standing

ONCE = "compiling for the first time; this happens once"
#: Lines of progress come after this time, then ever more rarely, s.
FIRST_LINE, LONGEST_PAUSE = 1.0, 60.0
#: Work that has no progress to show is spoken of after this time, s.
SILENCE = 10.0
#: Columns beside the live line: the spinner and a gap.
BESIDE = 2


class _Waiting:
    """Says now and then, elsewhere than on a terminal, that work without progress goes on."""

    def __init__(self, words: str, tell: Callable[[str], None]) -> None:
        self._words, self._tell = words, tell
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name="dap3d-progress", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """It has ended, or tells of itself from now on; nothing is said after this call."""
        self._ended.set()
        self._thread.join()

    def _work(self) -> None:
        begun, pause = time.monotonic(), SILENCE
        while not self._ended.wait(pause):
            elapsed = time.monotonic() - begun
            self._tell(f"{self._words}, for {seconds(elapsed)} so far")
            pause = min(elapsed, LONGEST_PAUSE)


class Preparing:
    """Shows on stderr what is prepared; a context manager.

    ``announce`` is told the names of kernels that are compiled, ``start`` says that the model is
    ready.
    """

    def __init__(self, *, quiet: bool) -> None:
        self._console: Terminal = messages()
        self._quiet = quiet
        self._bar: Progress | None = None
        self._task: Any = None
        self._told_once = False
        self._waiting: _Waiting | None = None
        self._next_line = FIRST_LINE
        live = self._console.file.isatty() and not self._console.is_dumb_terminal
        if live and not quiet:
            self._bar = self._display()

    def _display(self) -> Progress:
        """What stands on a terminal: a line that says all in words."""
        columns = SpinnerColumn("line"), TextColumn("{task.description}", markup=False)
        return _transient(*columns, console=self._console)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
            self._task = self._bar.add_task("preparing", total=None)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end_waiting()
        if self._bar is not None:
            self._bar.stop()

    def announce(self, kernel: str) -> None:
        """A kernel is about to be compiled."""
        self._end_waiting()
        self._tell_once()
        self._describe(f"compiling {kernel}", line=f"  {kernel}")

    def start(self) -> None:
        """The model is ready; its initial conditions are next."""
        self._describe("starting")
        if self._bar is None and not self._quiet:
            self._waiting = _Waiting("finding the initial conditions", self._print)

    def _end_waiting(self) -> None:
        if self._waiting is not None:
            self._waiting.end()
            self._waiting = None

    def _tell_once(self) -> None:
        if not self._told_once:
            self._told_once = True
            self._print(ONCE)

    def _describe(self, words: str, line: str = "") -> None:
        if self._bar is not None:
            self._bar.update(self._task, description=clean(words))
        elif line:
            self._print(line)

    def _print_line(self, words: str, elapsed: float) -> None:
        """A line of progress, after which there is none for a while."""
        self._print(words)
        self._next_line = elapsed + min(max(elapsed, FIRST_LINE), LONGEST_PAUSE)

    def _print(self, words: str) -> None:
        if not self._quiet:
            say(self._console, words)


class RunProgress(Preparing):
    """Shows how far a run is: ``advance`` is told how far the simulated time is."""

    def __init__(self, *, quiet: bool) -> None:
        super().__init__(quiet=quiet)
        self._begun: tuple[float, float] | None = None
        self._reached = 0.0

    def advance(self, run: "Standing") -> None:
        """The run stands so."""
        self._end_waiting()
        now = time.monotonic()
        if self._begun is None or run.t < self._reached:  # a second run begins
            self._begun, self._next_line = (now, run.t), FIRST_LINE
        self._reached = run.t
        elapsed, done = now - self._begun[0], run.t - self._begun[1]
        rate = done / elapsed if elapsed > 0.0 else 0.0
        if self._bar is not None:
            words = live_line(run, rate, self._console.width - BESIDE)
            self._bar.update(self._task, description=words)
        elif not self._quiet and elapsed >= self._next_line and run.t < run.t_end:
            self._print_line(plain_line(run, rate), elapsed)


class PointsProgress(Preparing):
    """Shows how far a study is: ``count`` is told how many of its points have been run.

    Attributes:
        ran: how many were run here.
        elapsed: seconds that took.
    """

    def __init__(self, *, quiet: bool) -> None:
        super().__init__(quiet=quiet)
        self._begun: tuple[float, int] | None = None
        self.ran, self.elapsed = 0, 0.0

    def count(self, done: int, total: int) -> None:
        """So many of all points are done."""
        now = time.monotonic()
        if self._begun is None:
            self._begun = (now, done)
        self.elapsed, self.ran = now - self._begun[0], done - self._begun[1]
        rate = self.ran / self.elapsed if self.elapsed > 0.0 else 0.0
        if self._bar is not None:
            words = points_line(done, total, rate, self._console.width - BESIDE)
            self._bar.update(self._task, description=words)
        elif not self._quiet and self.elapsed >= self._next_line and done < total:
            self._print_line(points_line(done, total, rate), self.elapsed)


def points_line(done: int, total: int, rate: float, width: int = 80) -> str:
    """How a study stands on one line: the fullest of several forms that fits.

    Args:
        done, total: points.
        rate: points a second, 0 where it is not known yet.
        width: columns there are.
    """
    part, left = f"{done / total:4.0%}", f"{clock((total - done) / rate) if rate else '-:--'} left"
    now, pace = f"{done:{len(f'{total:,}')},}", f"{rate:.3g} points/s" if rate else "- points/s"
    forms = [
        f"{part}  {now} of {total:,} points  {pace:>13}  {left}",
        f"{part} {now}/{total:,} {pace} {left}",
        f"{part} {pace} {left}",
    ]
    return next((words for words in forms if len(words) <= width), part)


def live_line(run: "Standing", rate: float, width: int) -> str:
    """How a run stands on one line: the fullest of several forms that fits.

    Simulated time, step, simulated time in a second of ours, drift of the energy, time left.
    Numbers keep their widths, so that the line does not jump.

    Args:
        run: how it stands.
        rate: simulated time over time, 0 where it is not known yet.
        width: columns there are.
    """
    part, end = f"{run.t / run.t_end if run.t_end else 1.0:4.0%}", f"{run.t_end:.4g}"
    digits = max(0, 3 - math.floor(math.log10(run.t_end or 1.0)))
    now = f"{run.t:{len(f'{run.t_end:.{digits}f}')}.{digits}f}"
    pace = f"{rate:.3g}" if rate else "-"
    step, drift, left = f"{run.step:.1e}", f"drift {run.drift:.0e}", f"{_left(run, rate)} left"
    forms = [
        f"{part}  t = {now} of {end} s  step {run.steps:,}: {step} s  {pace:>5}x real time  "
        f"{drift}  {left}",
        f"{part} {now} of {end} s, step {step} s, {pace:>5}x real time, {drift}, {left}",
        f"{now}/{end} s step {step} {pace:>5}x {drift} {left}",
        f"{part} {now}/{end} s {pace}x {drift} {left}",
        f"{part} {left}",
    ]
    return next((words for words in forms if len(words) <= width), part[:width])


def plain_line(run: "Standing", rate: float) -> str:
    """The same for a file or another program."""
    left = seconds((run.t_end - run.t) / rate) if rate else "?"
    return (
        f"t = {run.t:.4g} of {run.t_end:.4g} s ({run.t / run.t_end:.0%}), step {run.step:.2g} s, "
        f"{rate:.3g} x real time, energy drift {run.drift:.0e}, about {left} left"
    )


def _left(run: "Standing", rate: float) -> str:
    """The time that is left at this rate, as a clock shows it."""
    return clock((run.t_end - run.t) / rate) if rate else "-:--"


def clock(duration: float) -> str:
    """A time in s as a clock shows it."""
    minutes, rest = divmod(math.ceil(duration), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


@contextmanager
def counting(word: str, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Progress by numbers: a bar on a terminal, nothing elsewhere.

    Args:
        word: what is counted.
        quiet: whether nothing is shown on a terminal either.

    Yields:
        what is to be called with what is done and how much there is in all.
    """
    console = messages()
    if quiet or not console.file.isatty() or console.is_dumb_terminal:
        yield lambda done, total: None
        return
    with bar_of(console) as bar:
        task = bar.add_task("preparing", total=None)
        yield lambda done, total: bar.update(
            task, total=total, completed=done, description=f"{word} {done:,} of {total:,}"
        )


class _Left(TextColumn):
    """The estimate of the time that is left, empty as long as there is none."""

    def __init__(self) -> None:
        super().__init__("")

    def render(self, task: Task) -> Text:
        left = task.time_remaining
        known = left is not None and task.total is not None and not task.finished
        return Text(f"{seconds(left or 0.0)} left" if known else "")


def bar_of(console: Terminal) -> Progress:
    """Spinner, what is done, bar, percentage, estimate: 60 columns hold it."""
    narrow = console.width < 50
    columns: list[Any] = [SpinnerColumn("line"), TextColumn("{task.description}", markup=False)]
    if not narrow:
        columns.append(BarColumn(bar_width=14 if console.width < 72 else 24))
    return _transient(*columns, TaskProgressColumn(), _Left(), console=console)


def _transient(*columns: Any, console: Terminal) -> Progress:
    """Progress that leaves nothing behind on the screen."""
    return Progress(*columns, console=console, transient=True, refresh_per_second=8)
