"""An integration seen from Python: set up, advanced in chunks, drained of its rows, restored."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import UNSEEN
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.break_points import restart, stop_table
from dap3d_core.integrators.stepping.integration_state import Function, IntegrationState, Status
from dap3d_core.integrators.stepping.output import FAILED, dense_state
from dap3d_core.integrators.stepping.restore import GIVEN, Restorable
from dap3d_core.integrators.stepping.rounding import tolerance_of
from dap3d_core.integrators.stepping.step_control import FLOOR
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled, jit_is_on

#: Part of a state by which projections move it at most, as a rule.
MOST_MOVED = 1e-3
#: Part of the largest number by which a state is off its constraints, where no step has shown it.
OFF = 1e-10


@compiled
def project_here(work: Any, functions: Sequence[Function], system: Any, loops: Any) -> None:
    """Bring the state onto its constraints."""
    project = functions[1]
    project(work.t, work.state[at.Y], work.real[at.PROJECTED :], system, loops)


class StepCounts(NamedTuple):
    """Counts of an integration so far."""

    steps: int  # accepted
    rejected: int  # tried and thrown away
    rhs: int  # calls of rhs alone
    projections: int  # calls of project
    reports: int  # calls of report


class Refusals(NamedTuple):
    """Steps that an implicit integration refused so far, by the reason."""

    error: int  # larger than the tolerance
    iteration: int  # the iteration for the stages did not converge
    singular: int  # its matrix was singular
    worst: int  # component that changed most where the iteration did not converge, most often


def off_constraints(y: Floats) -> Floats:
    """A state (n,) a little off its constraints: one pass of a projection brings it back."""
    noise = np.random.default_rng(0).standard_normal(y.size)
    return y + OFF * float(np.max(np.abs(y))) * noise


class Integration(Restorable):
    """An initial value problem: ``advance`` it until its status is no longer RUNNING.

    Parameters
    ----------
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
        reporting time; adams takes none.
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
    watched
        1: the fourth function is called with each accepted state; 2: with ends of steps as well,
        which it may refuse (step_control.py).
    ends
        (2, q) for each switch that the fifth function gives, what it does: the run ENDS where it
        becomes negative; the integration BEGINS anew where it changes its sign
        (stepping/event_location.py), which is noted down, or UNSEEN, or a SEAM. And how far beyond
        zero it may be until that is so.
    stops
        Times in ascending order that no step goes over, and whether the right-hand side may jump
        there, so that the integration starts anew (stepping/break_points.py).
    kinds
        (n - 1,) for each component the first one of its kind: what its rounding is small against
        (stepping/rounding.py). Each is a kind of its own by default.

    Raises
    ------
    ValueError
        For tolerances or steps that make no sense.
    """

    #: Name in messages; whether it chooses its steps by their error.
    name: str
    adaptive: bool = True
    #: Class of ``work``, and rows of its ``state``.
    state_class: type[IntegrationState]
    state_rows = at.STATES
    #: Trailing components that never steer the step.
    unscaled_size = 0
    #: Whether its formulas are implicit; whether it goes on with its step where rates jump.
    implicit = False
    keeps_step = True
    #: The compiled loop of the integrator; its state at an instant within the last step.
    loop: Callable[..., None]
    dense: Callable[[Any, float, Floats], None] = staticmethod(dense_state)
    #: (k, 14) contacts of shapes at reported instants: t, i, j, mode, gap, point, normal, force.
    contact_rows: Floats = np.zeros((0, 14))
    #: Whether programs of a scene's own may take the place of its functions.
    takes_programs = False
    #: Whether ``complete`` adds means of the last step, which no later one knows.
    has_means = False

    def __init__(
        self,
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
        watched: int = 0,
        ends: ArrayLike = (),
        stops: Sequence[tuple[float, bool]] = (),
        kinds: ArrayLike = (),
    ) -> None:
        self._arguments = (functions, system, loops)
        y = np.array(y0, dtype=np.float64)
        instants = np.array(times, dtype=np.float64)
        check_control(self, rtol, atol, instants, step=step, first_step=first_step)
        size = y.size - self.unscaled_size
        rtol, atol = self.error_tolerances(rtol, atol)
        switches = np.asarray(ends, dtype=np.float64).reshape(2, -1)
        count = switches.shape[1]
        #: All the state there is, as arrays: copied and restored, the run continues from there.
        self.work: Any = self.state_class(
            real=np.zeros(at.MEASURES + length_count),
            integer=np.zeros(len(self.state_class.indices("integer")), dtype=np.int64),
            times=instants,
            state=np.zeros((self.state_rows, y.size)),
            rows=np.zeros((buffer_rows, 1 + y.size + report_size)),
            switches=np.zeros((at.SWITCH_ROWS, count)),
            crossings=np.zeros((at.LOGGED if count else 0, 3)),
            tolerance=tolerance_of(y.size, atol, kinds),
            stops=stop_table(stops, is_adaptive=step is None),
            limits=np.array([np.inf, 0.0, *np.zeros(at.MEASURES - at.PROJECTED + length_count)]),
            **self.own_arrays(y.size, length_count),
        )
        work = self.work
        work.state[at.Y] = y
        work.switches[[at.DOES, at.BAND]] = switches
        work.switch_count = count
        work.sampled_switch_count = int(np.count_nonzero(switches[0] != UNSEEN))
        work.t, work.h, work.fixed_step = instants[0], first_step or 0.0, step or 0.0
        work.rtol, work.error_size = rtol, size if error_size is None else error_size
        work.projects, work.calls_accepted = project_on, watched
        work.t_limit = work.step_limit_at_switch = work.longest_step = np.inf

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """Further arrays of ``work``, for ``size`` components."""
        raise NotImplementedError

    def error_tolerances(self, rtol: float, atol: ArrayLike) -> tuple[float, Any]:
        """Tolerances that the error estimate of a step is compared with."""
        return rtol, atol

    def compile(self) -> None:
        """Compile what ``advance`` needs, or load it, without doing a step."""
        status = int(self.work.status)
        self.work.status = Status.FINISHED
        self._advance(0)
        self.work.status = status

    @property
    def loop_arguments(self) -> tuple[Any, ...]:
        """Arguments of the compiled loop, but for its budget."""
        return self.work, *self._arguments

    def _advance(self, budget: int) -> None:
        """Call the compiled loop of the integrator."""
        self.call(self.loop, *self.loop_arguments, budget)

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a compiled function of arrays; derivatives are carried by another call."""
        return function(*arguments)

    def prepared(self) -> Callable[[int], Any]:
        """``advance`` for many short calls; of an integration whose rows are taken in time."""
        return self._advance if jit_is_on() else self.advance

    def advance(self, budget: int) -> Status:
        """Integrate until more than ``budget`` calls of rhs are spent, or the buffer is full.

        How a run is cut into chunks changes no bit of its result. Take the ``rows`` after each.

        Raises
        ------
        RuntimeError
            If the buffer is full on entry, so that nothing can be done.
        """
        if self.rows_are_full and self.status is Status.RUNNING:
            raise RuntimeError("the row buffer is full: take rows() before advancing")
        if jit_is_on():
            self._advance(budget)
        else:
            with np.errstate(all="ignore"):  # as in compiled code, which tests what matters
                self._advance(budget)
        return self.status

    def project(self) -> bool:
        """Bring the state onto its constraints; False if that failed."""
        work = self.work
        work.projection_moved = work.projection_outcome = 0.0
        work.projection_count += 1
        with np.errstate(all="ignore"):  # as compiled code does
            self.call(project_here, work, *self._arguments)
        if work.projection_outcome == FAILED:
            work.t_stop, work.status = self.t, Status.PROJECTION_FAILED
        return bool(work.projection_outcome != FAILED)

    def advance_to(self, limit: float) -> Status:
        """Try one step, or one towards a switch, that ends at time ``limit`` at the latest."""
        self.work.t_limit = limit
        status = self.advance(0)
        self.work.t_limit = np.inf
        return status

    def state_arrays(self) -> list[Any]:
        """All arrays that a step changes, but for rows that wait: copied and put back, as before.

        What ``functions`` keep in ``system`` is not among them.
        """
        same = (*GIVEN, "table", "crossings")
        names = [name for name, _ in self.work.type_of().members if name not in same]
        arrays = [getattr(self.work, name) for name in names]
        return [array for array in arrays if isinstance(array, np.ndarray)]

    def restart(self) -> None:
        """Let the next step start anew: what the functions compute has changed."""
        restart(self.work)

    def state_within(self, t: float) -> Floats | None:
        """(n,) state at a time within the last step, by its dense output; None where it has none.

        It is not projected.
        """
        work = self.work
        if not work.t_dense < t <= work.t_dense + work.h_dense:
            return None
        return self._interpolated(type(self).dense, t)

    def _interpolated(self, state_at: Any, t: float) -> Floats:
        y = self.y
        with np.errstate(all="ignore"):  # as compiled code does
            state_at(self.work, t, y)
        return y

    def complete(self, row: Floats) -> None:
        """Add to a row t, y, report of now what else is known of it: here nothing."""

    def contacts_at(self, t: float) -> Floats:
        """(k, 14) contacts of shapes now, at time t, as rows of ``contact_rows``: here none."""
        return self.contact_rows[:0]

    def end(self) -> None:
        """End the run here: the next ``advance`` reports this state, and stops."""
        self.work.end_status = Status.ENDED

    def rows(self) -> Floats:
        """Take the waiting rows out of the buffer: (k, 1 + n + report_size), each t, y, report."""
        taken: Floats = self.work.rows[: self.work.row_count].copy()
        self.work.row_count = 0
        return taken

    @property
    def status(self) -> Status:
        """State of progress."""
        return Status(int(self.work.status))

    @property
    def t(self) -> float:
        """Time reached by accepted steps."""
        return float(self.work.t)

    @property
    def y(self) -> Floats:
        """(n,) state at ``t``, a copy."""
        return self.work.state[at.Y].copy()

    @property
    def trial(self) -> Floats:
        """(n,) a state near ``y`` that is off its constraints as usual at the end of a step."""
        if self.work.step_count == 0:
            return off_constraints(self.y)
        y, other = self.y, self.work.state[at.OTHER]  # as it was before the last projection, or
        candidates: tuple[Floats, Floats] = other.copy(), y + other  # by how much that moved it
        for state in candidates:
            if np.max(np.abs(state - y)) <= MOST_MOVED * np.max(np.abs(y)):
                return state
        return y

    @property
    def t_stop(self) -> float | None:
        """Time of what stopped the run short: end of the step that failed, or a reporting time."""
        if self.status in (Status.RUNNING, Status.FINISHED):
            return None
        return float(self.work.t_stop)

    @property
    def overlapping(self) -> str:
        """Shapes that overlapped at the start, in words; or ""."""
        return ""

    @property
    def shortened(self) -> str:
        """Why steps are shorter than asked for, in words; or ""."""
        return ""

    @property
    def too_fast(self) -> str:
        """In words, what its steps cannot follow, which makes numbers overflow; "" for nothing."""
        return ""

    @property
    def driving(self) -> str:
        """A contact whose friction would drive, in words; or ""."""
        return ""

    @property
    def dy_dt(self) -> Floats | None:
        """(n,) dy/dt at ``t``, a copy; None where it is not known."""
        if self.work.first_stage_valid == 0:
            return None
        return self.work.k[0].copy()

    @property
    def refusals(self) -> Refusals | None:
        """Steps that an implicit integration refused; None of an explicit one."""
        return None

    @property
    def largest_work(self) -> float:
        """The largest magnitude of the last component at an accepted state."""
        return float(self.work.largest_work)

    @property
    def rate_noise(self) -> Floats:
        """(n,) change of dy/dt by the last digits of y, where that is more than errors of a step.

        As measured last (stepping/rounding.py); zeros where it was not.
        """
        return self.work.tolerance[at.NOISE].copy()

    @property
    def t_stiff(self) -> float | None:
        """Time since which the scene is stiff for this method, if noticed (stiffness.py)."""
        found = float(self.work.t_stiff)
        return found if 0.0 < found < np.inf else None

    @property
    def rows_are_full(self) -> bool:
        """True if ``rows`` must be taken before it can continue."""
        return int(self.work.row_count) == len(self.work.rows)

    @property
    def terminal_switch(self) -> int:
        """Index of the switch that ended the run."""
        return int(self.work.terminal_switch)

    @property
    def chatter(self) -> tuple[float, int]:
        """Since when, s, the changes of the culprit are counted, and how many there were."""
        since, count = self.work.switches[[at.SINCE, at.COUNT], self.terminal_switch]
        return float(since), int(count)

    @property
    def crossings(self) -> Floats:
        """(k, 3) time, which switch, to which side (+1 or -1): the first ``LOGGED`` of them."""
        return self.work.crossings[: self.crossing_count].copy()

    @property
    def crossing_count(self) -> int:
        """Number of sign changes of switches."""
        return int(self.work.crossing_count)

    @property
    def statistics(self) -> StepCounts:
        """Counts so far."""
        w = self.work
        counts = w.step_count, w.rejected_count, w.rhs_count, w.projection_count, w.report_count
        return StepCounts(*map(int, counts))


def check_control(
    integrator: Any,
    rtol: float,
    atol: ArrayLike,
    times: Floats,
    *,
    step: float | None,
    first_step: float | None,
) -> None:
    """ValueError for tolerances and steps that make no sense."""
    least = FLOOR * max(abs(times[0]), abs(times[-1]), times[-1] - times[0])
    for name, value in (("step", step), ("first_step", first_step)):
        if value is not None and not least < value < np.inf:
            raise ValueError(
                f"{name} is {value}; it must be finite and above {least:.1e}, the rounding of time"
            )
    if step is None and not integrator.adaptive:
        raise ValueError(
            f"{integrator.name} does not choose its step: give step, or take an adaptive method"
        )
    least_atol, most_atol = float(np.min(atol)), float(np.max(atol))
    good = 0.0 <= rtol < np.inf and 0.0 <= least_atol <= most_atol < np.inf
    if step is None and not (good and rtol + most_atol > 0.0):
        raise ValueError(
            f"rtol is {rtol} and atol {least_atol}: finite, not negative, not both zero"
        )
