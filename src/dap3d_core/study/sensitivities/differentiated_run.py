"""A run whose compiled code is differentiated, with jumps whose derivatives Python finds."""

import copy
from collections import deque
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Self

import numpy as np

from dap3d_core.formulations.programs.change_over import ChangeOver
from dap3d_core.integrators import TABLEAUS, Integration, Status, explicit
from dap3d_core.integrators.stepping.integration_state import CROSSED, Y
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.lanes import Differentiation
from dap3d_core.simulation import SimulationError
from dap3d_core.simulation.handover import switch_integrator
from dap3d_core.simulation.run import Run
from dap3d_core.study.batch.compiled_batch import arrays_of_numbers
from dap3d_core.study.sensitivities.neighbours import (
    Neighbours,
    arrays_of,
    floats_of,
    total_derivative,
)

if TYPE_CHECKING:
    from dap3d_core.simulation.events.jumps import Jumps

#: Part of a run by which a state lies before the jump of a switch.
BEFORE_JUMP = 1e-12
#: Part of the time after which shares end that differences may pass, and sooner than can be told;
#: change of a state, over its largest number, that is none of its motion.
SOON, AT_ONCE, NO_JUMP = 1e-7, 1e-10, 1e-10
#: Derivative of a slip, over the largest one of the state, that is rounding.
NO_SLIP = 1e-9
#: At the end of a slip: most that a step is of the time left; part of the way at which the last one
#: ends, from where slopes are extrapolated; states that are kept; steps that are taken at most.
PART, NEAREST, KEPT, MOST_STEPS = 0.25, 1e-6, 256, 20_000
#: Part of the time below which the way is none: its steps would be rounding of it.
NO_WAY = 1e-9


class DifferentiatedRun(Run):
    """A run with its derivatives by some parameters.

    Attributes:
        neighbours: of each parameter.
        base: the run at its start, for differences of what Python computes.
        reported, slopes: (k, width) rows in coordinates of bodies, and (k, width, p) their
            derivatives, in parts.
        instants: time of each located event and jump -> (p,) its derivatives.
        in_turns: time from which on slip began and ended at once, by rounding; infinite if never.
    """

    def carry(self, neighbours: Sequence[Neighbours], base: Run, lanes: int) -> Self:
        """Carry derivatives from the start on; lanes: directions that code is compiled for."""
        self.neighbours, self.base, self._lanes = list(neighbours), base, lanes
        self.reported: list[Floats] = []
        self.slopes: list[Floats] = []
        self.instants: dict[float, Floats] = {}
        self.in_turns = np.inf
        # of them, and the switches that crossed there
        self._latest = -np.inf, np.zeros(len(self.neighbours)), np.zeros(0, dtype=np.int64)
        return self

    def begin(self, integration: Integration) -> None:
        """As of ``RunState``: the integration is differentiated."""
        is_first = not self.integrations
        if is_first:
            self._differentiation = Differentiation(1 + self._lanes)
        super().begin(integration)
        integration.call = self._differentiation.call  # type: ignore[method-assign]
        integration.rows = self._rows  # type: ignore[method-assign]
        if is_first:
            self._seed()
        integration.compile()
        if integration.takes_programs:
            self.programs = self._programs()
        if self.jumps is not None:
            if is_first:
                law = type(self.jumps)
                self.jumps.begin = self._jumping(law.begin)  # type: ignore
                self.jumps.apply = self._jumping(law.apply)  # type: ignore
                self._ending = EndingSlip(self, self._differentiation)
            integration.advance = partial(self._ending.advance, integration)  # type: ignore

    def observe_present(self) -> None:
        """As of ``RunState``: one that goes on has the derivatives of the one before."""
        super().observe_present()
        if len(self.integrations) > 1:
            before, work = self.integrations[-2].work, self.present.work
            for argument in self.present.loop_arguments:
                self._differentiation.wide(argument)
            self._differentiation.take()
            t = work.indices("real")["t"]
            self._slopes_of(work.state[Y])[:] = self._slopes_of(before.state[Y])
            self._slopes_of(work.real)[t] = self._slopes_of(before.real)[t]

    def _slopes_of(self, array: Floats) -> Floats:
        """(size, p) view of the derivatives of an array of the integration."""
        return self._differentiation.slopes(array)[:, : len(self.neighbours)]

    def _seed(self) -> None:
        """Derivatives of all numbers at the start."""
        for argument in self.present.loop_arguments:
            self._differentiation.wide(argument)
        arrays = floats_of(self)
        ends = np.cumsum([array.size for array in arrays.values()])[:-1]
        for j, beside in enumerate(self.neighbours):
            if beside.copied is not None:
                of_numbers, of_state = beside.copied
                for array, slope in zip(arrays_of_numbers(self.evaluator), of_numbers, strict=True):
                    self._slopes_of(array)[:, j] = slope
                self._slopes_of(self.present.work.state[Y])[:, j] = of_state
                continue
            found = beside.derivative(
                lambda run: _finite(np.concatenate([*floats_of(run).values()]))
            )
            for array, slope in zip(arrays.values(), np.split(found, ends), strict=True):
                self._slopes_of(array)[:, j] = slope

    def _programs(self) -> ChangeOver:
        """Programs of the scene in differentiated form; numbers that have slopes are loaded."""
        evaluator = copy.copy(self.evaluator)
        evaluator.functions = self._differentiation.wide(evaluator.functions)
        evaluator.loops = self._differentiation.wide(evaluator.loops)
        varied = {
            name: np.flatnonzero(self._slopes_of(array).any(axis=1))
            for name, array in evaluator.system.walk()
            if array.dtype.kind == "f" and array.size
        }
        return ChangeOver(evaluator, varied, self._differentiation.count)

    def _rows(self) -> Floats:
        """As ``Integration.rows``; their derivatives are kept."""
        integration = self.present
        work, count = integration.work, int(integration.work.row_count)
        raw = work.rows[:count].copy()
        slopes = self._slopes_of(work.rows)[: count * work.rows.shape[1]]
        slopes = slopes.reshape(count, work.rows.shape[1], len(self.neighbours)).copy()
        if count and not self.evaluator.coordinates.are_of_bodies:
            motion = slice(1, work.state.shape[1])  # without the work done, which may be large
            slopes = self._derivative(
                lambda run, rows: run.evaluator.body_rows(rows), raw, slopes, motion
            )
        if count:
            self.slopes.append(slopes)
            self.reported.append(self.evaluator.body_rows(raw))
        for row in work.crossings[: integration.crossing_count]:
            place, t = int(np.flatnonzero(work.crossings[:, 0] == row[0])[0]), float(row[0])
            slopes = self._slopes_of(work.crossings)[3 * place].copy()
            if np.isnan(slopes).any():
                raise self._none_of(t, int(row[1]))
            self.instants[t] = slopes
        return type(integration).rows(integration)

    def _derivative(
        self, function: Callable[[Run, Floats], Floats], x: Floats, slopes: Floats, motion: slice
    ) -> Floats:
        return total_derivative(function, self.neighbours, self.base, x, slopes, motion)

    def _jumping(self, change: Callable[..., None]) -> Callable[[Integration], None]:
        """A jump of velocities, whose derivatives are those of the law that Python solves."""
        of = self.jumps
        assert of is not None

        def jump(integration: Integration) -> None:
            work, put = integration.work, self._putting()
            given = np.append(work.state[Y], work.t)
            crossed = np.flatnonzero(work.switches[CROSSED])
            of_state, of_time = self._slopes_before(of, put, given)

            def after(run: Run, state: Floats) -> Floats:
                put(run)
                own = run.present.work
                own.state[Y], own.t = state[:-1], state[-1]
                if run not in others:
                    others[run] = type(of)(run.evaluator)
                jumps = others[run]
                jumps.span = of.span
                jumps.repeat_of(of)
                try:
                    change(jumps, run.present)
                except SimulationError as error:  # shorter differences may not come to that
                    failures.append(error)
                    return np.full_like(own.state[Y], np.nan)
                return own.state[Y].copy()

            failures: list[SimulationError] = []
            others: dict[Run, Jumps] = {}
            change(of, integration)
            motion = slice(0, -2)  # without the work done and time
            slopes, is_soon = np.full(1, np.nan), self._shares_again(of, crossed, given)
            if not is_soon or given[-1] - self._latest[0] > AT_ONCE * given[-1]:
                slopes = self._derivative(after, given, np.vstack([of_state, of_time]), motion)
            if is_soon and np.isnan(slopes).any():
                later = self._latest[1] - of_time
                of_state = of_state + np.outer(self._rates_before(self.base, put, given), later)
                of_time = of_time + later
                slopes = self._derivative(after, given, np.vstack([of_state, of_time]), motion)
            if np.isnan(slopes).any():
                what = f"there is no derivative of what happens at t = {work.t:.9g} s"
                raise SimulationError(f"{what}: {failures[-1]}") from failures[-1]
            if change is type(of).begin:
                self._refuse_slip_from_rest(slopes)
            self.instants[float(work.t)] = of_time
            self._latest = work.t, of_time, crossed
            self._ending.forget()
            self._differentiation.take()
            self._slopes_of(work.state)[: work.state.shape[1]] = slopes
            self._slopes_of(work.real)[work.indices("real")["t"]] = of_time

        return jump

    def _slopes_before(
        self, of: "Jumps", put: Callable[[Run], None], given: Floats
    ) -> tuple[Floats, Floats]:
        """(n, p) and (p,) derivatives of the state before a jump and of its time."""
        work = self.present.work
        of_time = self._slopes_of(work.real)[work.indices("real")["t"]].copy()
        of_state = self._slopes_of(work.state)[: work.state.shape[1]].copy()
        ended = self._ended_slip(of)
        begun = self._ending.begun_at_once(work.t) if ended >= 0 else None
        if begun is not None:
            self.in_turns = min(self.in_turns, float(work.t))
            of_state, of_time = (slopes[..., : len(self.neighbours)] for slopes in begun)
        elif (k := ended if ended >= 0 else self._jumped_switch()) >= 0:
            if ended >= 0:
                of_state, of_time = self._to_end_of_slip(work.t), np.zeros_like(of_time)
            rates = self._rates_before(self, put, given)
            late = self._slopes_of_jump(k, put, rates, given, np.vstack([of_state, of_time]))
            of_state, of_time = of_state + np.outer(rates, late), of_time + late
            put(self)
        return of_state, of_time

    def _putting(self) -> Callable[[Run], None]:
        """What makes all numbers those of the present, in a run, with its parameter's change."""
        present = [(name, array.copy()) for name, array in arrays_of(self)]
        system = {
            name: self._slopes_of(array).copy()
            for name, array in arrays_of(self)
            if array.dtype.kind == "f" and not name.startswith("0.") and array.size
        }

        def put(run: Run) -> None:
            if run.present.implicit != self.present.implicit:
                if len(run.integrations) == 1:
                    switch_integrator(run)
                else:
                    run.integrations.reverse()
            arrays = dict(arrays_of(run))
            offset, j = self._offset_of(run)
            for name, array in present:
                arrays[name][...] = array
                if offset and name in system:
                    arrays[name] += offset * system[name][:, j].reshape(array.shape)

        return put

    def _ended_slip(self, of: "Jumps") -> int:
        """The switch of a contact whose slip has come to an end; -1 where there is none."""
        work = self.present.work
        ended = [k for k in of.sliding() if work.switches[CROSSED, k] != 0.0]
        return ended[0] if ended and self._ending.leads_to(work.t) else -1

    def _to_end_of_slip(self, t: float) -> Floats:
        """(n, p) derivatives of the state at time t; those of waiting rows are put right."""
        work = self.present.work
        slopes, rows = self._ending.slopes(t)
        of_rows, width = self._differentiation.slopes(work.rows), work.rows.shape[1]
        for k in range(int(work.row_count)):
            if (found := rows.get(float(work.rows[k, 0]))) is not None:
                of_rows[k * width : (k + 1) * width] = found
        return slopes[:, : len(self.neighbours)]

    def _jumped_switch(self) -> int:
        """The switch that has jumped as it was crossed; -1 where none has."""
        switches = self.present.work.switches
        slopes = self._slopes_of(switches)[CROSSED * switches.shape[1] :][: switches.shape[1]]
        found = np.flatnonzero(np.isnan(slopes).any(axis=1))
        slopes[found] = 0.0
        return int(found[0]) if len(found) else -1

    def _refuse_slip_from_rest(self, slopes: Floats) -> None:
        """Where a contact begins to slide from rest, the least slip decides in which direction.

        slopes: (size, p) derivatives of the state there.
        """
        of, put, y = self.jumps, self._putting(), self.present.work.state[Y].copy()
        assert of is not None
        sliding = of.sliding_from_rest(self.present)
        put(self)  # as it was: steps read what is in the system
        if not sliding:
            return

        def slips(run: Run, state: Floats) -> Floats:
            put(run)
            run.present.work.state[Y] = state
            return type(of)(run.evaluator).slips(run.present)[list(sliding.values())]

        of_slips = np.abs(self._derivative(slips, y, slopes, slice(0, -1)))
        largest = np.max(np.abs(slopes), axis=0, initial=0.0)
        for name, moved in zip(sliding, of_slips, strict=True):
            for neighbours, most, size in zip(
                self.neighbours, np.max(moved, axis=0), largest, strict=True
            ):
                if most > NO_SLIP * size:
                    raise SimulationError(
                        f"there is no derivative by {neighbours.parameter.name}: contact {name} "
                        "begins to slide from rest, and the least slip would decide in which "
                        "direction; give it some at the start"
                    )

    def _none_of(self, t: float, k: int) -> SimulationError:
        """The error where the instant of switch k has no derivative."""
        name = self.evaluator.switches[k].name(self.evaluator.model)
        what = f"there is no derivative of the instant t = {t:.9g} s"
        return SimulationError(f"{what}: the switch of {name} jumps there")

    def _shares_again(self, of: "Jumps", crossed: Integers, given: Floats) -> bool:
        """True where contacts share anew, ever sooner, what soon no share holds: all slide then.

        When that is shows in the instants that lead there; the last ones are by rounding of shares.

        given: the state before, and time.
        """
        t, size = given[-1], len(given) - 2 - len(self.evaluator.states)
        far, most = np.abs(self.present.y - given[:-1])[:size], np.max(np.abs(given[:size]))
        before, _, others = self._latest
        is_soon = t - before <= SOON * t and np.all(far <= NO_JUMP * most)
        return bool(is_soon) and of.share(crossed, others)

    def _rates_before(self, run: Run, put: Callable[[Run], None], given: Floats) -> Floats:
        """dy/dt just before an instant, of a run that has the state and time given."""
        put(run)
        evaluator, (y, t) = run.evaluator, (given[:-1], given[-1])
        back = BEFORE_JUMP * self.present.work.times[-1]
        return evaluator.slope(t - back, y - back * evaluator.slope(t, y))

    def _slopes_of_jump(
        self, k: int, put: Callable[[Run], None], rates: Floats, given: Floats, slopes: Floats
    ) -> Floats:
        """(p,) derivatives of the time by which a switch jumps later where parameters differ.

        Args:
            k: the switch.
            put: makes all but the state that of the instant, in a run.
            rates: dy/dt before it.
            given: state and time there; slopes: (size, p) derivatives of both.

        Raises:
            SimulationError: states beside do not come to a jump.
        """
        side, end = self.present.work.switches[CROSSED, k], self.present.work.times[-1]

        def delay(run: Run, state: Floats) -> Floats:
            put(run)
            y, t, of = state[:-1], state[-1], run.evaluator

            def is_behind(dt: float) -> bool:
                return bool(of.switch_values(t + dt, y + dt * rates)[k] * side > 0.0)

            reach = BEFORE_JUMP * end
            while is_behind(-reach) or not is_behind(reach):
                reach *= 2.0
                if reach > end:
                    return np.array([np.nan])
            low, high = -reach, reach
            while low < (middle := 0.5 * (low + high)) < high:
                low, high = (low, middle) if is_behind(middle) else (middle, high)
            return np.array([high])

        found = self._derivative(delay, given, slopes, slice(0, -2))[0]
        if np.isnan(found).any():
            raise self._none_of(given[-1], k)
        return found

    def _offset_of(self, run: Run) -> tuple[float, int]:
        """How far the parameter of a neighbour is from its value, and which one it is."""
        for j, beside in enumerate(self.neighbours):
            if offset := beside.offset_of(run):
                return offset, j
        return 0.0, 0


def _finite(x: Floats) -> Floats:
    """Numbers, with zero for those that are not finite: limits that are not set."""
    return np.where(np.isfinite(x), x, 0.0)


class EndingSlip:
    """The latest states of a differentiated run, and the way from one to where slip ends.

    Friction acts along the slip u, a direction that changes by du / |u|: next to the end of a slip
    that is stiff, and its own motion does not show it. Where slip goes straight, one step reaches
    the end. States are those of the run. Their derivatives are carried once more, from where steps
    became long beside the time that was left, by steps that are a part of it.
    """

    def __init__(self, run: Run, differentiation: Differentiation) -> None:
        """Args: the run, which follows contacts by events; its derivatives."""
        self._run, self._differentiation = run, differentiation
        self._states: deque[tuple[float, Floats, Floats, Floats]] = deque(maxlen=KEPT)

    def advance(self, integration: Integration, budget: int) -> Status:
        """As ``Integration.advance``, step by step while slip of contacts has a direction."""
        law, most = self._run.jumps, integration.statistics.rhs + budget
        assert law is not None
        advance: Callable[..., Status] = type(integration).advance
        if not law.sliding():
            return advance(integration, budget)
        while True:
            if not self._states or integration.t > self._states[-1][0]:
                work = integration.work
                slopes = self._differentiation.slopes(work.state[Y]).copy()
                of_time = self._differentiation.slopes(work.real)[work.indices("real")["t"]].copy()
                self._states.append((integration.t, integration.y, slopes, of_time))
            status = advance(integration, 0)
            rhs, is_full = integration.statistics.rhs, integration.rows_are_full
            if status is not Status.RUNNING or rhs > most or is_full:
                return status

    def forget(self) -> None:
        """Where something jumps, what was before leads no further."""
        self._states.clear()

    def leads_to(self, t: float) -> bool:
        """True if a state before time t is known, from which slip has come."""
        return bool(self._states) and self._states[0][0] < t

    def begun_at_once(self, t: float) -> tuple[Floats, Floats] | None:
        """Slopes of state and time where the slip began that ends at time t, if it does at once."""
        begun, _, slopes, of_time = self._states[0]
        return (slopes, of_time) if t - begun <= NO_WAY * t else None

    def slopes(self, t: float) -> tuple[Floats, dict[float, Floats]]:
        """Slopes (n, lanes) of the state at time t, at which slip ends; of rows before, by time.

        Raises:
            SimulationError: they cannot be carried there.
        """
        carried, differentiation = self._carried, self._differentiation
        arrays = differentiation.arrays()
        present = [array.copy() for array in arrays]
        times = np.array([*(state[0] for state in self._states if state[0] < t), t])
        is_long = np.diff(times) > PART * (t - times[:-1])  # the last one is
        begun, y, slopes, of_time = self._states[int(np.argmax(is_long))]
        slopes = slopes - np.outer(self._run.evaluator.slope(begun, y), of_time)  # at that instant
        self._set(begun, y, slopes)
        found, rows = [(begun, slopes)], {}
        while (left := t - carried.t) > NEAREST * (t - begun):
            limit = t - (1.0 - PART) * left
            while carried.t < limit:
                status = carried.advance_to(limit)
                if status is not Status.RUNNING or carried.statistics.steps > MOST_STEPS:
                    what = f"there is no derivative of what happens at t = {t:.9g} s"
                    raise SimulationError(f"{what}: slip ends there, in what is stiff besides")
                of_rows = differentiation.slopes(carried.work.rows)
                for k, row in enumerate(carried.rows()):
                    rows[float(row[0])] = of_rows[k * row.size : (k + 1) * row.size].copy()
            of_state = differentiation.slopes(carried.work.state[Y])
            found.append((carried.t, of_state.copy()))
        (t_0, slopes_0), (t_1, slopes_1) = found[-2:]
        for array, numbers in zip(arrays, present, strict=True):
            array[...] = numbers
        return slopes_1 + (slopes_1 - slopes_0) * ((t - t_1) / (t_1 - t_0)), rows

    def _set(self, t: float, y: Floats, slopes: Floats) -> None:
        """Begin at a state of the run."""
        carried, differentiation = self._carried, self._differentiation
        work, arrays = carried.work, carried.state_arrays()
        for array, first in zip(arrays, self._first, strict=True):
            array[...] = first
        work.t, work.state[Y] = t, y
        work.next_report = np.searchsorted(work.times, t, side="right")
        carried.restart()
        differentiation.take()
        for array in arrays:
            if array.dtype == np.float64:
                differentiation.slopes(array)[:] = 0.0
        differentiation.slopes(work.state[Y])[:] = slopes

    @cached_property
    def _carried(self) -> Integration:
        """What goes on from a state of the run, without its switches."""
        run, times = self._run, self._run.present.work.times
        options = run.options | {"ends": (), "step": None, "first_step": None}
        carried = explicit(TABLEAUS["dop853"], run.evaluator, run.present.y, times, **options)
        carried.call = self._differentiation.call  # type: ignore[method-assign]
        for argument in carried.loop_arguments:
            self._differentiation.wide(argument)
        carried.compile()
        self._first = [array.copy() for array in carried.state_arrays()]
        return carried
