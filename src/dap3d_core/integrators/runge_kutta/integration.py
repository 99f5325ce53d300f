"""One integration, seen from Python: set up, advanced in chunks, drained of its rows."""

from bisect import bisect_left
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import UNSEEN
from dap3d_core.integrators.runge_kutta.step import advance
from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers, Method, combinations
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.input_checks import (
    check_control,
    check_sizes,
    check_state_and_times,
)
from dap3d_core.integrators.stepping.integration_state import Function, Status, Work
from dap3d_core.integrators.stepping.output import FAILED
from dap3d_core.integrators.stepping.restore import Restorable
from dap3d_core.integrators.stepping.rounding import tolerance_of
from dap3d_core.kernels.runtime.cache import jit_is_on


class Statistics(NamedTuple):
    """What an integration has done so far."""

    steps: int  # accepted
    rejected: int  # tried and thrown away
    rhs: int  # calls of rhs alone
    projections: int  # calls of project
    reports: int  # calls of report


class Integration(Restorable):
    """An initial value problem on its way: ``advance`` it until its status is no longer RUNNING.

    Parameters
    ----------
    method
        One of ``METHODS``.
    functions
        ``[rhs, project, report]``: a typed list of first-class functions of the signature
        ``void(t, y, out, system, loops)`` (step.py says what each does); a plain list where
        compilation is off. ``project`` is called only with ``project_on``.
    system, loops
        Handed on to the functions: a tuple of arrays, and a typed list of first-class functions.
    y0
        (n,) state at ``times[0]``, used as it is: it is not projected.
    times
        (nt,) increasing reporting times; the first is t0, the last t_end.
    rtol, atol
        Tolerances: the error of a step is measured by ``atol + rtol max(|y0|, |y1|)``; atol is one
        number, or one for each component.
    step
        Fixed step, without error control: equal steps, none longer. A method with dense output
        takes them from t0 to t_end, one without (rk4, which needs ``step``) from reporting time to
        reporting time.
    first_step
        First step that error control tries; by default it is chosen as in HNW I, II.4.
    project_on
        Whether accepted steps and interpolated states are projected.
    error_size
        Number of leading components that steer the step; all by default.
    report_size
        Number of values that ``report`` gives.
    buffer_rows
        Number of rows that wait at most to be taken by ``rows``.
    length_count
        Number of lengths that ``project`` gives, which vanish at singular states
        (stepping/singular_poses.py).
    leave_stiff
        Whether to stop, with status STIFF, where the scene turns out stiff for the method.
    watched
        Whether the fourth function is called with each accepted state.
    ends
        (2, q) for each switch that the fifth function gives, what it does: the run ENDS where it
        becomes negative; the integration BEGINS anew where it changes its sign
        (stepping/event_location.py), which is noted down, or UNSEEN. And how far beyond zero it may
        be until that is so.

    Raises
    ------
    ValueError
        For times, sizes, tolerances or steps that make no sense.
    """

    #: Times in ascending order that no step goes over, and whether the right-hand side may jump
    #: there, so that the integration starts anew.
    stops: Sequence[tuple[float, bool]] = ()
    #: Whether its formulas are implicit.
    implicit = False

    def __init__(
        self,
        method: Method,
        functions: Sequence[Function],
        system: Any,
        loops: Any,
        y0: ArrayLike,
        times: ArrayLike,
        *,
        rtol: float = 1e-8,
        atol: ArrayLike = 1e-10,
        step: float | None = None,
        first_step: float | None = None,
        project_on: bool = False,
        error_size: int | None = None,
        report_size: int = 0,
        buffer_rows: int = 256,
        length_count: int = 0,
        watched: bool = False,
        leave_stiff: bool = False,
        ends: ArrayLike = (),
    ) -> None:
        self.method = method
        self._arguments = (functions, system, loops)
        y = np.array(y0, dtype=np.float64)
        instants = np.array(times, dtype=np.float64)
        check_state_and_times(y, instants)
        check_control(method, rtol, atol, instants, step=step, first_step=first_step)
        error_size = y.size if error_size is None else error_size
        check_sizes(error_size, y.size, buffer_rows)

        of_method, counts = _facts(method)
        real = np.zeros(at.LENGTHS + length_count)
        real[: at.LENGTHS] = of_method
        real[at.RTOL] = rtol
        real[at.STEP], real[at.H] = step or 0.0, first_step or 0.0
        real[at.T] = instants[0]
        integer = counts.copy()
        switches, crossings = switches_of(integer, ends)
        integer[at.ERROR_SIZE] = error_size
        integer[at.PROJECT_ON], integer[at.WATCHED] = project_on, watched
        integer[at.LEAVE] = leave_stiff
        state = np.zeros((at.STATES, y.size))
        state[at.Y] = y
        #: All the state there is, as arrays: copied and put back, the run goes on from there.
        self.work = Work(
            real=real,
            integer=integer,
            times=instants,
            state=state,
            k=np.zeros((len(method.a), y.size)),
            terms=np.zeros((4 + len(method.d), y.size)),
            rows=np.empty((buffer_rows, 1 + y.size + report_size)),
            table=combinations(method),
            lengths=np.full((2, length_count), np.nan),
            switches=switches,
            crossings=crossings,
            tolerance=tolerance_of(y.size, atol),
        )

    def compile(self) -> None:
        """Compile what ``advance`` needs, or load it, without doing a step."""
        status = int(self.work.integer[at.STATUS])
        self.work.integer[at.STATUS] = Status.FINISHED
        self._advance(0)
        self.work.integer[at.STATUS] = status

    def _advance(self, budget: int) -> None:
        advance(self.work, *self._arguments, budget)

    def advance(self, budget: int) -> Status:
        """Go on until more than ``budget`` calls of rhs are spent, the buffer is full, or the end.

        How a run is cut into chunks changes no bit of its result. Take the ``rows`` after each.

        Raises
        ------
        RuntimeError
            If the buffer is full on entry, so that nothing can be done.
        """
        if self.rows_are_full and self.status is Status.RUNNING:
            raise RuntimeError("the row buffer is full: take rows() before advancing")
        asked = self.work.real[at.LIMIT]
        if self.stops:
            self.work.real[at.LIMIT] = min(asked, self._next_stop())
        self._go(budget)
        self.work.real[at.LIMIT] = asked
        return self.status

    def _go(self, budget: int) -> None:
        if jit_is_on():
            self._advance(budget)
        else:
            with np.errstate(all="ignore"):  # as in compiled code, which tests what matters
                self._advance(budget)

    def _next_stop(self) -> float:
        """The time that the next step may not go over.

        Where the right-hand side may jump steps end just before and go on just behind, so that none
        has samples of both sides; the state stays, which is right to the rounding of time, but for
        what the constraints make of it there. Fixed steps end on their grid, and on what jumps.
        """
        real, is_adaptive = self.work.real, self.work.real[at.STEP] == 0.0
        for t, jumps in self.stops[bisect_left(self.stops, (self.t, False)) :]:
            before = float(np.nextafter(t, -np.inf)) if jumps and is_adaptive else t
            if self.t < before:
                return before
            if before < t:
                real[[at.T, at.LIMIT]] = t
                self._go(0)  # no step: what is asked for at t is reported
                if self.rows_are_full or self.status is not Status.RUNNING:
                    return t
                real[at.T] = np.nextafter(t, np.inf)
                self.restart()
                if not self._project():
                    return t
        return np.inf

    def _project(self) -> bool:
        """Bring the state onto its constraints where they have moved, if that is on.

        Whether the run goes on.
        """
        functions, system, loops = self._arguments
        real, integer = self.work.real, self.work.integer
        if integer[at.PROJECT_ON] == 0:
            return True
        outcome = real[at.OUTCOME :]
        outcome[:2] = 0.0
        integer[at.PROJECTIONS] += 1
        with np.errstate(all="ignore"):  # as compiled code does
            functions[1](self.t, self.work.state[at.Y], outcome, system, loops)
        if outcome[1] == FAILED:
            real[at.T_STOP], integer[at.STATUS] = self.t, Status.PROJECTION_FAILED
        return bool(outcome[1] != FAILED)

    def advance_to(self, limit: float) -> Status:
        """Try one step, or what stands in its place, that ends at time ``limit`` at the latest."""
        self.work.real[at.LIMIT] = limit
        status = self.advance(0)
        self.work.real[at.LIMIT] = np.inf
        return status

    def state_arrays(self) -> list[Any]:
        """All arrays that a step changes, but for rows that wait: copied and put back, as before.

        What ``functions`` keep in ``system`` is not among them.
        """
        same = ("times", "rows", "table", "crossings")
        names = [name for name, _ in self.work.type_of().members if name not in same]
        arrays = [getattr(self.work, name) for name in names]
        return [array for array in arrays if isinstance(array, np.ndarray)]

    def restart(self) -> None:
        """Let the next step start anew: what the functions compute has changed."""
        work = self.work
        work.real[at.H] = 0.0
        work.real[at.ERROR_OLD], work.real[at.CUT] = 1e-4, np.inf
        work.integer[[at.FRESH, at.LOOKED, at.LAST_REJECTED, at.CUTS]] = 0
        work.switches[at.SIDE] = 0.0

    def end(self) -> None:
        """End the run where it stands: the next ``advance`` reports this state, and stops."""
        self.work.integer[at.ENDING] = Status.ENDED

    def rows(self) -> Floats:
        """Take the waiting rows out of the buffer: (k, 1 + n + report_size), each t, y, report."""
        integer = self.work.integer
        taken: Floats = self.work.rows[: integer[at.ROW]].copy()
        integer[at.ROW] = 0
        return taken

    @property
    def status(self) -> Status:
        """Where the integration stands."""
        return Status(int(self.work.integer[at.STATUS]))

    @property
    def t(self) -> float:
        """Time reached by accepted steps."""
        return float(self.work.real[at.T])

    @property
    def y(self) -> Floats:
        """(n,) state at ``t``, a copy."""
        y: Floats = self.work.state[at.Y].copy()
        return y

    @property
    def t_stop(self) -> float | None:
        """Time of what stopped the run short: end of the step that failed, or a reporting time."""
        if self.status in (Status.RUNNING, Status.FINISHED):
            return None
        return float(self.work.real[at.T_STOP])

    @property
    def slope(self) -> Floats | None:
        """(n,) dy/dt at ``t``, a copy; None where it is not known."""
        if self.work.integer[at.FRESH] == 0:
            return None
        slope: Floats = self.work.k[0].copy()
        return slope

    @property
    def most_work(self) -> float:
        """The largest magnitude of the last component at an accepted state."""
        return float(self.work.real[at.MOST_WORK])

    @property
    def stiff_at(self) -> float | None:
        """Time since which the scene is stiff for this method, if noticed (stiffness.py)."""
        found = float(self.work.real[at.STIFF_AT])
        return found if 0.0 < found < np.inf else None

    @property
    def rows_are_full(self) -> bool:
        """Whether ``rows`` must be taken before it can go on."""
        return int(self.work.integer[at.ROW]) == len(self.work.rows)

    @property
    def culprit(self) -> int:
        """Which switch ended the run, where one did."""
        return int(self.work.integer[at.CULPRIT])

    @property
    def chatter(self) -> tuple[float, int]:
        """Since when, s, the changes of the culprit are counted, and how many there were."""
        since, count = self.work.switches[[at.SINCE, at.COUNT], self.culprit]
        return float(since), int(count)

    @property
    def crossings(self) -> Floats:
        """(k, 3) time, which switch, to which side (+1 or -1): the first ``LOGGED`` of them."""
        found: Floats = self.work.crossings[: self.crossing_count].copy()
        return found

    @property
    def crossing_count(self) -> int:
        """How often a switch has changed its sign."""
        return int(self.work.integer[at.CROSSINGS])

    @property
    def statistics(self) -> Statistics:
        """What has been done so far."""
        integer = self.work.integer
        names = (at.STEPS, at.REJECTED, at.RHS, at.PROJECTIONS, at.REPORTS)
        return Statistics(*(int(integer[i]) for i in names))


def switches_of(integer: Integers, ends: ArrayLike) -> tuple[Floats, Floats]:
    """Arrays of the switches (ends: as ``Integration`` has it), none looked at so far."""
    given = np.asarray(ends, dtype=np.float64).reshape(2, -1)
    count = integer[at.SWITCHES] = given.shape[1]
    switches = np.zeros((at.SWITCH_ROWS, count))
    if count:
        switches[[at.DOES, at.BAND]] = given
        integer[at.SAMPLED] = np.count_nonzero(given[0] != UNSEEN)
    return switches, np.zeros((at.LOGGED if count else 0, 3))


@cache
def _facts(method: Method) -> tuple[Floats, Integers]:
    """What ``real`` and ``integer`` hold of a method, found once: small runs take microseconds."""
    real = np.zeros(at.LENGTHS)
    real[at.EXPONENT], real[at.BETA] = method.exponent, method.beta
    real[at.FACTOR_MIN], real[at.FACTOR_MAX] = method.factor_min, method.factor_max
    real[at.ERROR_OLD], real[at.CALM], real[at.SAFETY] = 1e-4, method.calm, method.safety
    real[[at.LIMIT, at.CUT, at.STIFF_AT, at.LONGEST]] = np.inf
    integer = np.zeros(at.INTEGERS, dtype=np.int64)
    integer[at.STAGES], integer[at.ORDER] = method.stages, method.order
    integer[at.ERRORS], integer[at.DENSE] = len(method.e), method.dense
    integer[at.ERROR_USES_RESULT] = method.error_uses_result
    integer[at.LATE_STAGE] = method.late_stage
    return real, integer
