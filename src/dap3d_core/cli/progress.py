"""What a run shows while it works: a bar on a terminal, now and then a line elsewhere."""

import time
from types import TracebackType
from typing import Any, Self

from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TaskProgressColumn, TextColumn
from rich.text import Text

from dap3d_core.cli.rendering import Terminal, clean, messages, say, seconds

ONCE = "compiling for the first time; this happens once"
#: Lines of progress come after this time, then ever more rarely, s.
FIRST_LINE, LONGEST_PAUSE = 1.0, 60.0


class RunProgress:
    """Shows how far a run is, on stderr.

    Use as a context manager. ``announce`` is told the names of kernels that are compiled,
    ``advance`` how far the simulated time is; ``start`` says that the model is ready.
    """

    def __init__(self, *, quiet: bool) -> None:
        self._console: Terminal = messages()
        self._quiet = quiet
        self._bar: Progress | None = None
        self._task: Any = None
        self._told_once = False
        self._begun: float | None = None
        self._reached = 0.0
        self._next_line = FIRST_LINE
        live = self._console.file.isatty() and not self._console.is_dumb_terminal
        if live and not quiet:
            self._bar = _bar(self._console)

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
        if self._bar is not None:
            self._bar.stop()

    def announce(self, kernel: str) -> None:
        """A kernel is about to be compiled."""
        self._tell_once()
        self._describe(f"compiling {kernel}", line=f"  {kernel}")

    def start(self) -> None:
        """The model is ready; its initial conditions are next."""
        self._describe("starting")

    def advance(self, t: float, t_end: float) -> None:
        """The run has come to simulated time t of t_end, s."""
        if self._begun is None or t < self._reached:  # a second run begins
            self._begun, self._next_line = time.monotonic(), FIRST_LINE
        self._reached = t
        if self._bar is not None:
            words = f"t = {t:.4g} of {t_end:.4g} s"
            self._bar.update(self._task, total=t_end, completed=t, description=words)
        elif not self._quiet:
            self._line(t, t_end, time.monotonic() - self._begun)

    def _line(self, t: float, t_end: float, elapsed: float) -> None:
        if elapsed < self._next_line or t <= 0.0 or t >= t_end:
            return
        left = seconds(elapsed * (t_end - t) / t)
        words = f"t = {t:.4g} of {t_end:.4g} s ({t / t_end:.0%}), about {left} left"
        self._print(words)
        self._next_line = elapsed + min(max(elapsed, FIRST_LINE), LONGEST_PAUSE)

    def _tell_once(self) -> None:
        if not self._told_once:
            self._told_once = True
            self._print(ONCE)

    def _describe(self, words: str, line: str = "") -> None:
        if self._bar is not None:
            self._bar.update(self._task, description=clean(words))
        elif line:
            self._print(line)

    def _print(self, words: str) -> None:
        if not self._quiet:
            say(self._console, words)


class _Left(TextColumn):
    """The estimate of the time that is left, empty as long as there is none."""

    def __init__(self) -> None:
        super().__init__("")

    def render(self, task: Task) -> Text:
        left = task.time_remaining
        known = left is not None and task.total is not None and not task.finished
        return Text(f"{seconds(left or 0.0)} left" if known else "")


def _bar(console: Terminal) -> Progress:
    """Spinner, what is done, bar, percentage, estimate: 60 columns hold it."""
    narrow = console.width < 50
    columns: list[Any] = [SpinnerColumn("line"), TextColumn("{task.description}", markup=False)]
    if not narrow:
        columns.append(BarColumn(bar_width=14 if console.width < 72 else 24))
    columns += [TaskProgressColumn(), _Left()]
    return Progress(*columns, console=console, transient=True, refresh_per_second=8)
