"""The error of a run, estimated by a second one: tolerances ten times tighter, or half the step."""

import os
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.result import Computed, Note, Result, ResultError, estimated_error, information
from dap3d_core.result.post.global_error import MEANINGLESS
from dap3d_core.scene import SceneError, Simulation
from dap3d_core.settings import SMALLEST_RTOL
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.initial.tolerances import tighter, words_of

#: The second run's tolerances are those of the first divided by this.
TIGHTER = 10.0
#: Its first step, as a part of the mean step of the first run. Error control starts from a step
#: that hardly depends on the tolerance, and lets it grow by a largest factor: two runs would begin
#: with equal steps, and their equal errors would not show in the difference.
FIRST_STEP = 0.01
#: The value of ``estimate_error`` for an estimate where it takes less than QUICK_SECONDS, and the
#: time of a second run as a multiple of that of the first, at most.
QUICK, QUICK_SECONDS, SLOWER = "quick", 1.0, 2.0


class OutOfTimeError(Exception):
    """A second run takes longer than it may."""


class StepLimits(NamedTuple):
    """Limits on the steps of a second run, s: the first, and the longest.

    Where a state is below the tolerances steps grow as far as they may, in both runs, and errors
    that are the same in both do not show.
    """

    first: float
    longest: float


#: Makes a run with other settings, with limits on its steps where these are controlled, that takes
#: so many seconds at most.
Again = Callable[[Simulation, StepLimits | None, float], Result]
#: A callback ``watch`` of a run.
Watch = Callable[[Any], None]


def tightened(settings: Simulation) -> Simulation | None:
    """Settings of the second run; None where tolerances cannot be tightened any more."""
    if settings.step is not None:
        return attrs.evolve(settings, step=settings.step / 2.0)
    rtol = float(settings.rtol)
    if rtol / TIGHTER < SMALLEST_RTOL:
        return None
    return attrs.evolve(settings, rtol=rtol / TIGHTER, atol=tighter(settings.atol, TIGHTER))


def ending_after(seconds: float, watch: Watch | None) -> Watch | None:
    """A callback that ends a run by OutOfTimeError after so many seconds, and calls another one."""
    if seconds == np.inf:
        return watch
    last = time.perf_counter() + seconds

    def check(progress: Any) -> None:
        if time.perf_counter() > last:
            raise OutOfTimeError
        if watch is not None:
            watch(progress)

    return check


def add_error(
    result: Result,
    settings: Simulation,
    again: Again,
    output: str | os.PathLike[str] | None,
    *,
    quick: bool = False,
) -> None:
    """Estimate the error of a result by a second run, and write it into its file as well.

    Where the second run fails, the result stays as it is and a note says why it has no estimate.

    Args:
        result: of the first run, which reached its end.
        settings: of that run.
        again: makes the second run.
        output: the file of the result, None where it has none.
        quick: only where that takes less than QUICK_SECONDS; that there is no estimate, for which
            nobody asked, is for information.

    Raises:
        BaseException: whatever ends the second run from outside (Ctrl-C, an exception of
            ``progress``); it carries the first result as ``.result``.
    """
    none = (information if quick else Note)("its error was not estimated")
    too_long = f"{none}: that takes longer than {QUICK_SECONDS:g} s"
    finer_settings = tightened(settings)
    if finer_settings is None:
        _amend(result, output, f"{none}: rtol {settings.rtol:g} cannot be made any tighter")
        return
    if quick and SLOWER * result.stats.wall_time_s > QUICK_SECONDS:
        _amend(result, output, too_long)
        return
    words = _words(finer_settings)
    try:
        limits = _limits(result, finer_settings)
        second = again(finer_settings, limits, QUICK_SECONDS if quick else np.inf)
    except OutOfTimeError:
        _amend(result, output, too_long)
        return
    except (SimulationError, SceneError) as error:
        _amend(result, output, f"{none}: in a second run at {words}, {error}")
        return
    except BaseException as error:
        _amend(result, output, "the estimate of its error was ended early and left out")
        Computed(result).attach(error)
        raise
    if not _same_instants(result, second):
        _amend(result, output, f"{none}: a second run at {words} ended elsewhere, by its events")
        return
    steps = second.stats.steps
    result.arrays = result.arrays.with_error(estimated_error(result.u, second.u, steps))
    by = f"by a second run at {words} ({steps:,} steps)"
    note = information(f"the error is estimated {by}")
    _amend(result, output, note, *_divergence_note(result))


def _same_instants(result: Result, second: Result) -> bool:
    """True if two runs reported at the same times; those of an event differ by its error."""
    if len(result.t) != len(second.t):
        return False
    spacing = float(np.max(np.diff(result.t))) if len(result.t) > 1 else 0.0
    return bool(np.all(np.abs(result.t - second.t) <= 1e-3 * spacing))


def _limits(result: Result, settings: Simulation) -> StepLimits | None:
    if settings.step is not None or not result.stats.steps:
        return None
    mean = float(result.t[-1] - result.t[0]) / result.stats.steps
    return StepLimits(FIRST_STEP * mean, mean)


def with_midpoints(stops: Sequence[tuple[float, bool]]) -> list[tuple[float, bool]]:
    """Instants that no step goes over, and others in between: a step of the first run between two
    of them is at least two of the second.
    """
    between = [(0.5 * (a + b), False) for (a, _), (b, _) in pairwise(stops)]
    return sorted([*stops, *between])


def _words(settings: Any) -> str:
    if settings.step is not None:
        return f"steps of {settings.step:g} s"
    return f"rtol {settings.rtol:g}, atol {words_of(settings.atol)}"


def _divergence_note(result: Result) -> list[str]:
    """A note on where the error has become as large as to leave the state no meaning."""
    error = result.error
    assert error is not None
    if (when := error.meaningless_from) is None:
        return []
    note = (
        f"from t = {when:.6g} s on the estimated error is beyond {MEANINGLESS:g} of the size of "
        "the motion: what follows is not the motion of this scene, and its estimate no measure of "
        "how far it is off"
    )
    if (tenfold := error.tenfold) is None:
        return [f"{note}. A tighter rtol, or a shorter step, goes further"]
    return [
        f"{note}. Until then it grew exponentially, tenfold every {tenfold:.3g} s (chaos): an "
        f"error of the steps ten times smaller holds about {tenfold:.3g} s longer"
    ]


def _amend(result: Result, output: str | os.PathLike[str] | None, *notes: str) -> None:
    """Add notes, and bring the file up to date."""
    result.record = attrs.evolve(result.record, notes=(*result.notes, *notes))
    if output is None:
        return
    try:
        result.save(output, force=True)
    except ResultError as error:
        raise ResultError(
            f"{error}; it holds the whole run, without the estimate of its error: free as much "
            "room again, and run it anew"
        ) from error
