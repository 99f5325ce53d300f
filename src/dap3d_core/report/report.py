"""The work-precision report: its runs and failures, and their JSON, CSV and picture."""

import csv
import io
import json
import math
import os
import statistics
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.report.measurement import Failed, MeasuredRun, RejectedSetting
from dap3d_core.report.reference import Reference
from dap3d_core.result import current_versions
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.scene.display import html_table

#: An error counts as smaller than another below this fraction of it: equal motions differ in
#: their rounding.
BETTER = 0.95
#: Uncertainty, as a factor, of a run timed once: another program may have run.
ONCE = 3.0


@attrs.frozen
class Recommendation:
    """The fastest setting that reaches an error.

    Attributes:
        target_error: the error e to reach.
        run: the fastest run; None where no setting reaches it.
        reason: the reason, for users.
        flags: its options of the command line; "" without a run.
    """

    target_error: float
    run: MeasuredRun | None
    reason: str
    flags: str

    def to_dict(self) -> dict[str, Any]:
        """The recommendation in JSON."""
        run = None if self.run is None else self.run.to_dict()
        return attrs.asdict(self, recurse=False) | {"run": run}


#: Columns of the table that are not counts.
COLUMNS = (
    *("method", "integrator", "rtol", "atol", "step"),
    *(f.name for f in attrs.fields(MeasuredRun) if f.name not in ("setting", "counts")),
    "failed",
)


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Report:
    """Speed against error of one scene.

    Attributes:
        scene: its name.
        t_end, dt: final time and reporting step, s.
        runs: completed settings, by method and integrator, coarse ones first.
        failed: settings that were not completed, with reasons.
        refused: methods that do not fit the scene, with reasons.
        reference: the trajectory that errors are measured against.
        target_error: the requested error, or None.
        status: "done" or "interrupted".
        notes: limitations of the report.
        versions: of dap3d, numpy, llvmlite, python.
    """

    scene: str
    t_end: float
    dt: float
    runs: tuple[MeasuredRun, ...]
    failed: tuple[Failed, ...]
    refused: tuple[RejectedSetting, ...]
    reference: Reference
    target_error: float | None = None
    status: str = "done"
    notes: tuple[str, ...] = ()
    versions: dict[str, str] = attrs.Factory(current_versions)

    def __repr__(self) -> str:
        counts = f"{len(self.runs)} settings ran, {len(self.failed)} failed"
        return f"<Report {self.scene!r}: {self.status}, {counts}; {self.recommended().reason}>"

    def _repr_html_(self) -> str:
        """The settings that ran as a table, for notebooks."""
        header = "method", "integrator", "rtol", "step [s]", "time [s]", "error", "on the front"
        rows = [
            (r.method, r.integrator, r.rtol, r.step, r.time_s, r.error, "yes" if r.on_front else "")
            for r in self.runs
        ]
        return f"<p>{escape(repr(self)[1:-1])}</p>{html_table(header, rows)}"

    def recommended(self, target_error: float | None = None) -> Recommendation:
        """The fastest setting that reaches an error.

        Args:
            target_error: the error e to reach; by default the one the report was made for, or 1e-6.

        Raises:
            ValueError: the target is not a positive number.
        """
        wanted = target_error if target_error is not None else self.target_error
        return recommend(self.runs, self.reference.uncertainty, 1e-6 if wanted is None else wanted)

    def to_dict(self) -> dict[str, Any]:
        """The report in JSON; see docs/how-to/report.md."""
        reference = self.reference
        expected = reference.expected
        return {
            "scene": self.scene,
            "t_end": self.t_end,
            "dt": self.dt,
            "status": self.status,
            "runs": [run.to_dict() for run in self.runs],
            "failed": [each.to_dict() for each in self.failed],
            "refused": [attrs.asdict(each) for each in self.refused],
            "reference": {
                "settings": [setting.flags for setting in reference.settings],
                "uncertainty": reference.uncertainty,
                "instants": len(reference.t),
                "measured_to": float(reference.t[-1]),
                "meaningless_from": reference.meaningless_from,
                "expected": None if expected is None else attrs.asdict(expected),
                "notes": list(reference.notes),
            },
            "recommended": self.recommended().to_dict(),
            "notes": list(self.notes),
            "versions": self.versions,
        }

    def to_json(self) -> str:
        """The text of one JSON object (RFC 8259): ``to_dict``."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def to_csv(self) -> str:
        """A table of all settings, failed ones with their reason; numbers read back bit for bit."""
        rows = [run.to_dict() for run in self.runs]
        rows += [each.to_dict() for each in self.failed]
        counts = dict.fromkeys(key for row in rows for key in row if key not in COLUMNS)
        text = io.StringIO()
        table = csv.DictWriter(text, (*COLUMNS[:-1], *counts, COLUMNS[-1]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
        return text.getvalue()

    def save_csv(self, path: str | os.PathLike[str], force: bool = False) -> Path:
        """Write ``to_csv`` to a file, whole or not at all.

        Raises:
            ResultError: it cannot be written, or exists and ``force`` is off.
        """
        target = Path(path)
        with whole_file(target, force) as part:
            part.write_text(self.to_csv(), "utf-8")
        return target

    def plot(self, path: str | os.PathLike[str], force: bool = False, **options: Any) -> Path:
        """Draw time against error into a file; arguments as ``save_work_precision``.

        Raises:
            ValueError: there is no run to draw, or the suffix is none of a picture.
            ResultError: it cannot be written, or exists and ``force`` is off.
        """
        from dap3d_core.plot.work_precision import Mark, save_work_precision

        marks = [
            Mark(run.method, run.integrator, run.error, run.time_s, run.on_front)
            for run in self.runs
        ]
        title, uncertainty = self.scene, self.reference.uncertainty
        return save_work_precision(marks, path, title, uncertainty, force=force, **options)


def front(runs: Sequence[MeasuredRun], uncertainty: float | None) -> set[int]:
    """Indices of the runs on the Pareto front: no faster run has a smaller error.

    Errors below the uncertainty of the reference count as that uncertainty.
    """
    least, members = math.inf, set()
    for k in sorted(range(len(runs)), key=lambda k: (runs[k].time_s, runs[k].error)):
        error = known_error(runs[k], uncertainty)
        if error < BETTER * least:
            least = error
            members.add(k)
    return members


def known_error(run: MeasuredRun, uncertainty: float | None) -> float:
    """Upper bound of a run's error: at least the uncertainty of the reference."""
    return max(run.error, uncertainty or 0.0)


def recommend(
    runs: Sequence[MeasuredRun], uncertainty: float | None, target_error: float
) -> Recommendation:
    """The fastest run with an error known to be within the target.

    Of runs equally fast within the spread of the timings, the one with the least work: evaluations
    of the right-hand side times their mean cost over all runs of its method and integrator.

    Raises:
        ValueError: the target is not a positive number.
    """
    if not 0.0 < target_error < math.inf:
        raise ValueError(f"a target of the error is a positive number, not {target_error}")
    reaching = [run for run in runs if known_error(run, uncertainty) <= target_error]
    if not reaching:
        return Recommendation(target_error, None, _why_none(runs, uncertainty, target_error), "")
    fastest = min(reaching, key=lambda run: run.time_s)
    costs = _costs(runs)
    best = min(
        (run for run in reaching if _overlap(fastest, run)),
        key=lambda run: (run.counts["rhs"] * costs[run.method, run.integrator], run.time_s),
    )
    return Recommendation(target_error, best, _why(best, reaching), best.setting.flags)


def _overlap(fast: MeasuredRun, slow: MeasuredRun) -> bool:
    """True if the timings of two runs overlap."""
    if min(fast.repeats, slow.repeats) < 2:
        return slow.time_s <= ONCE * fast.time_s
    return slow.time_min_s <= fast.time_max_s


def _costs(runs: Sequence[MeasuredRun]) -> dict[tuple[str, str], float]:
    """Seconds per right-hand side of each method and integrator: the median over their runs."""
    costs: dict[tuple[str, str], list[float]] = {}
    for run in runs:
        cost = run.time_s / max(run.counts["rhs"], 1)
        costs.setdefault((run.method, run.integrator), []).append(cost)
    return {series: statistics.median(values) for series, values in costs.items()}


def _why(best: MeasuredRun, reaching: Sequence[MeasuredRun]) -> str:
    is_fastest = best.time_s <= min(run.time_s for run in reaching)
    rank = "is the fastest" if is_fastest else "takes the least work"
    words = (
        f"{best.setting} {rank} of {len(reaching)} settings that reach it, with an error "
        f"of {best.error:.1e} in {1e3 * best.time_s:.3g} ms and {best.counts['rhs']:,} right-hand "
        "sides"
    )
    others = [
        run for run in reaching if (run.method, run.integrator) != (best.method, best.integrator)
    ]
    if not others:
        return words
    other = min(others, key=lambda run: run.time_s)
    ratio = other.time_s / best.time_s
    words += f"; next is {other.setting} at {ratio:.2g} times its time"
    if min(best.repeats, other.repeats) < 2:
        return f"{words}, each timed once"
    within = _overlap(*sorted((best, other), key=lambda run: run.time_s))
    return f"{words}, which is within the spread of the timings" if within else words


def _why_none(runs: Sequence[MeasuredRun], uncertainty: float | None, target_error: float) -> str:
    if not runs:
        return "no setting came to its end"
    if uncertainty is not None and uncertainty > target_error:
        return (
            f"errors below {uncertainty:.1e}, the uncertainty of the reference, cannot be told "
            "from one another"
        )
    nearest = min(runs, key=lambda run: run.error)
    return f"no setting reaches it; the nearest is {nearest.setting} with {nearest.error:.1e}"
