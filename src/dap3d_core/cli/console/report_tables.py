"""What ``dap3d report`` shows: a bar while it works, tables that 60 columns hold."""

import time
from typing import TYPE_CHECKING

from rich.progress import Progress
from rich.text import Text

from dap3d_core.cli.console.console import (
    Terminal,
    clean,
    count,
    facts,
    items,
    say,
    seconds,
    show,
    table,
    title,
)
from dap3d_core.cli.console.progress import LONGEST_PAUSE, RunProgress, bar_of

if TYPE_CHECKING:
    from dap3d_core.report import Report, Run

#: From this width on there is room for the counts and the constraints.
WIDE = 76
#: Errors that settings are named for where no target is given.
TARGETS = (1e-3, 1e-6, 1e-9)
#: Seconds between lines of progress where no terminal is.
PAUSE = 5.0


class ReportProgress(RunProgress):
    """Shows how much of a report's work is done, on stderr."""

    def __init__(self, *, quiet: bool) -> None:
        super().__init__(quiet=quiet)
        self._told = time.monotonic()
        self._pause = PAUSE

    def _display(self) -> Progress:
        return bar_of(self._console)

    def work(self, done: float, total: float, words: str) -> None:
        """Of ``total`` seconds of work, ``done`` are over; what is going on."""
        if self._bar is not None:
            shown = clean(words)[: max(12, self._console.width - 44)]
            if total > done:  # of a part, as a changing total would make rich forget its estimate
                self._bar.update(self._task, total=1.0, completed=done / total, description=shown)
            else:
                self._bar.update(self._task, description=shown)
        elif time.monotonic() - self._told > self._pause:
            self._told = time.monotonic()
            self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
            left = f", about {seconds(total - done)} left" if total > done else ""
            self._print(f"{words}{left}")


def show_report(console: Terminal, found: "Report", command: str, *, with_target: bool) -> None:
    """A whole report: what was run, the reference, the runs by series, what to take.

    Args:
        console: where.
        found: the report.
        command: what runs the model, to which the flags of a setting are added.
        with_target: whether an error was asked for.
    """
    words = "" if found.status == "done" else f": {found.status}"
    title(console, f"speed against error: {found.scene or 'scene without a name'}{words}")
    facts(
        console,
        [
            ("simulated", f"t = 0 to {found.t_end:g} s, reported every {found.dt:g} s"),
            ("reference", _reference(found)),
            ("uncertainty", _uncertainty(found)),
            ("expected", _expected(found)),
        ],
    )
    for method, integrator in dict.fromkeys((r.method, r.integrator) for r in found.runs):
        runs = [r for r in found.runs if (r.method, r.integrator) == (method, integrator)]
        title(console, f"{method}, {integrator}")
        _show_runs(console, runs)
    if found.runs:
        words = "* no faster run has a smaller error"
        if any(run.below_uncertainty for run in found.runs):
            words += "; < below the uncertainty of the reference"
        say(console, words)
    _show_failures(console, found)
    if found.notes or found.reference.notes:
        title(console, "notes")
        items(console, (*found.reference.notes, *found.notes))
    _show_recommended(console, found, command, with_target=with_target)


def _reference(found: "Report") -> str:
    first, *second = found.reference.settings
    return str(first) + (f"; compared with {second[0]}" if second else "; a single run")


def _uncertainty(found: "Report") -> str:
    reference = found.reference
    if reference.uncertainty is None:
        return "not known"
    words = f"{reference.uncertainty:.1e}, the difference of the two"
    if reference.meaningless_from is not None:
        words += f" up to t = {reference.t[-1]:.6g} s; later they part, and errors mean nothing"
    return words


def _expected(found: "Report") -> str:
    expected = found.reference.expected
    if expected is None:
        return ""
    verdict = "within" if expected.within else "NOT within"
    numbers = count(expected.count, "independent value")
    return (
        f"{numbers} of expected.toml, largest deviation {expected.deviation:.1e}, {verdict} the "
        "tolerances there"
    )


def _show_runs(console: Terminal, runs: "list[Run]") -> None:
    wide = console.width >= WIDE
    columns = ["", "setting", "time", "error", "energy"]
    columns += ["|C|", "steps", "rhs"] if wide else ["rhs"]
    rows = [_row(run, wide=wide) for run in runs]
    every = range(len(columns))
    show(console, table(columns, rows, right=tuple(every)[2:], fixed=tuple(every)))


def _row(run: "Run", *, wide: bool) -> list[str | Text]:
    error = f"{'<' if run.below_uncertainty else ''}{run.error:.1e}"
    cells: list[str | Text] = [
        Text("*" if run.on_front else "", style="bold green"),
        run.setting.control,
        seconds(run.time_s),
        error,
        f"{run.energy_error:.1e}",
    ]
    rhs = f"{run.counts['rhs']:,}"
    if not wide:
        return [*cells, rhs]
    return [*cells, f"{run.constraint_error:.0e}", f"{run.counts['steps']:,}", rhs]


def _show_failures(console: Terminal, found: "Report") -> None:
    if found.failed:
        title(console, "settings that gave no result")
        items(console, [f"{each.setting}: {each.reason}" for each in found.failed], "red")
    if found.refused:
        title(console, "methods that do not fit")
        items(console, [f"{each.method}: {each.reason}" for each in found.refused])


def _show_recommended(
    console: Terminal, found: "Report", command: str, *, with_target: bool
) -> None:
    title(console, "what to take")
    targets = (None,) if with_target else TARGETS
    for target in targets:
        advice = found.recommended(target)
        say(console, f"for an error of {advice.target_error:g}: {advice.reason}", indent=2)
        if advice.flags:
            say(console, f"{command} {advice.flags}", "green", indent=4, whole=True)
