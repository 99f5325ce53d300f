"""Output of ``dap3d report``: progress of its work, and tables that fit into 60 columns."""

import time
from typing import TYPE_CHECKING

from rich.progress import Progress
from rich.text import Text

from dap3d_core.cli.console.console import Terminal, clean, count, scene_name, seconds
from dap3d_core.cli.console.progress import ProgressBar, bar_of

if TYPE_CHECKING:
    from dap3d_core.report import MeasuredRun, Report

#: Width from which the counts and the constraints are shown.
WIDE = 76
#: Errors for which settings are recommended by default.
TARGETS = (1e-3, 1e-6, 1e-9)
#: Time to the first line of progress without a terminal, s.
PAUSE = 5.0


class ReportProgress(ProgressBar):
    """Shows the progress of a report on stderr."""

    def __init__(self) -> None:
        super().__init__()
        self._next_line, self._since = PAUSE, time.monotonic()

    def _make_bar(self) -> Progress:
        return bar_of(self._console)

    def work(self, done: float, total: float, words: str) -> None:
        """Show that ``done`` of ``total`` seconds of work are over, and the current work."""
        if self._bar is not None:
            shown = clean(words)[: max(12, self._console.width - 44)]
            if total > done:  # as a fraction: rich drops its estimate when a total changes
                self._bar.update(self._task, total=1.0, completed=done / total, description=shown)
            else:
                self._bar.update(self._task, description=shown)
        else:
            left = f", about {seconds(total - done)} left" if total > done else ""
            self._print_at_times(f"{words}{left}", time.monotonic() - self._since)


def show_report(console: Terminal, report: "Report", command: str, *, with_target: bool) -> None:
    """Print a report; ``command`` runs the model once the flags of a setting are appended."""
    status = "" if report.status == "done" else f": {report.status}"
    console.title(f"speed against error: {scene_name(report.scene)}{status}")
    console.facts(
        [
            ("simulated", f"t = 0 to {report.t_end:g} s, reported every {report.dt:g} s"),
            ("reference", _reference(report)),
            ("uncertainty", _uncertainty(report)),
            ("expected", _expected(report)),
        ]
    )
    for method, integrator in dict.fromkeys((r.method, r.integrator) for r in report.runs):
        console.title(f"{method}, {integrator}")
        runs = [r for r in report.runs if (r.method, r.integrator) == (method, integrator)]
        wide = console.width >= WIDE
        columns = ["", "setting", "time", "error", "energy"]
        columns += ["|C|", "steps", "rhs"] if wide else ["rhs"]
        rows = [_row(run, wide=wide) for run in runs]
        every = range(len(columns))
        console.table(columns, rows, right=tuple(every)[2:], fixed=tuple(every))
    if report.runs:
        legend = "* no faster run has a smaller error"
        if any(run.below_uncertainty for run in report.runs):
            legend += "; < below the uncertainty of the reference"
        console.say(legend)
    failed = [f"{each.setting}: {each.reason}" for each in report.failed]
    console.section("settings that gave no result", failed, "red")
    refused = [f"{each.method}: {each.reason}" for each in report.refused]
    console.section("methods that do not fit", refused)
    console.section("notes", (*report.reference.notes, *report.notes))
    console.title("recommended")
    for target in (None,) if with_target else TARGETS:
        advice = report.recommended(target)
        console.say(f"for an error of {advice.target_error:g}: {advice.reason}", indent=2)
        if advice.flags:
            console.say(f"{command} {advice.flags}", "green", indent=4, whole=True)


def _reference(report: "Report") -> str:
    first, *second = report.reference.settings
    return str(first) + (f"; compared with {second[0]}" if second else "; a single run")


def _uncertainty(report: "Report") -> str:
    reference = report.reference
    if reference.uncertainty is None:
        return "not known"
    text = f"{reference.uncertainty:.1e}, the difference of the two"
    if reference.meaningless_from is not None:
        last = f"{reference.t[-1]:.6g} s"
        text += f" up to t = {last}; later they diverge, and errors are meaningless"
    return text


def _expected(report: "Report") -> str:
    expected = report.reference.expected
    if expected is None:
        return ""
    verdict = "within" if expected.within else "NOT within"
    values = count(expected.count, "independent value")
    return (
        f"{values} of expected.toml, largest deviation {expected.deviation:.1e}, {verdict} the "
        "tolerances there"
    )


def _row(run: "MeasuredRun", *, wide: bool) -> list[str | Text]:
    return [
        Text("*" if run.on_front else "", style="bold green"),
        run.setting.control,
        seconds(run.time_s),
        f"{'<' if run.below_uncertainty else ''}{run.error:.1e}",
        f"{run.energy_error:.1e}",
        *([f"{run.constraint_error:.0e}", f"{run.counts['steps']:,}"] if wide else []),
        f"{run.counts['rhs']:,}",
    ]
