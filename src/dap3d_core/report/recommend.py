"""Recommendation of a setting for a target error, with its reason."""

import math
import statistics
from collections.abc import Sequence
from typing import Any

import attrs

from dap3d_core.report.measurement import MeasuredRun

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
        return {
            "target_error": self.target_error,
            "run": None if self.run is None else self.run.to_dict(),
            "reason": self.reason,
            "flags": self.flags,
        }


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
