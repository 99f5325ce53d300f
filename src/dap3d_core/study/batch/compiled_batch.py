"""Batches of runs of one machine, seen from Python: arrays made ready, one compiled call, rows."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.arrays import STEPS, System, step_functions
from dap3d_core.formulations import Formulation
from dap3d_core.formulations.evaluator import Machine
from dap3d_core.integrators import EXPLICIT, IMPLICIT, INTEGRATORS
from dap3d_core.integrators.runge_kutta.step import advance
from dap3d_core.integrators.stepping.integration_state import Status, Work
from dap3d_core.kernels.runtime.cache import table_of
from dap3d_core.kernels.runtime.function_lists import INTEGER, LOOP_LIST, procedure_signature
from dap3d_core.scene import Simulation
from dap3d_core.simulation.initial.assemble import model_size
from dap3d_core.simulation.settings import fits, integration_options
from dap3d_core.study.batch import driver as at
from dap3d_core.study.batch import initial_state
from dap3d_core.study.batch.driver import Points, run_points

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Right-hand sides after which a compiled call comes back, so that Ctrl-C is answered.
CALL = 200_000
#: Constants of the metric in which displacements are measured in m (Model.length) and rad.
UNIT = np.array([1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])

_DRIVE = procedure_signature(Work.type_of(), STEPS, System.type_of(), LOOP_LIST, INTEGER)


class Found(NamedTuple):
    """What came of k runs.

    Attributes:
        done: (k,) whether a run went to its end; the others are to be run by themselves.
        rows: (k, nt, width) what was reported, as the integrator delivers it.
        given, y0: (k, n) the state that each was given, and the one it started from.
        numbers: (k, COLUMNS) see driver.py and initial_state.py.
    """

    done: NDArray[np.bool_]
    rows: Floats
    given: Floats
    y0: Floats
    numbers: Floats


class Runs:
    """Runs of one machine that differ in numbers alone. Not for two threads at once.

    Attributes:
        machine: what evaluates the model.
        size: a length of the model, m.
        first: the work of the integration as it is before a run, by name.
        last_start: (n,) the state that the last run started from.
    """

    def __init__(
        self,
        machine: Machine,
        settings: Simulation,
        times: Floats,
        stops: list[tuple[float, bool]],
    ) -> None:
        """Args:
        machine: what evaluates the model; its numbers change.
        settings: of the runs; the integrator is a one-step one, or "auto": a run that turns
            out stiff is then not done.
        times: (nt,) reporting times.
        stops: times that no step goes over, and whether something jumps there.
        """
        self.machine = machine
        y0 = machine.integrated(machine.model.u0)
        tries = settings.integrator == "auto"
        self.integration = INTEGRATORS.get(str(settings.integrator), EXPLICIT).make(
            machine,
            y0,
            times,
            buffer_rows=len(times),
            leave_stiff=tries and fits(IMPLICIT, machine.formulation),  # as Run does
            **integration_options(machine, settings),
        )
        self.stops = np.array(stops, dtype=float).reshape(-1, 2)
        self._metric = machine.system.metric.copy()
        unit = UNIT.copy()
        unit[0] = machine.model.length
        self._unit = unit
        work = self.integration.work
        self.first: dict[str, Any] = {
            "first_real": work.real.copy(),
            "first_integer": work.integer.copy(),
            "first_switches": work.switches.copy(),
            "first_lengths": work.lengths.copy(),
        }
        self._starting = _starting(machine.formulation)
        self.size = model_size(machine)
        self.last_start = y0
        self._told = np.zeros(initial_state.STARTING + machine.plan.row_size)
        self._told[initial_state.SIZE] = self.size
        without = np.flatnonzero(~machine.model.position_row)
        self._told[initial_state.STARTING + machine.system.row[without]] = 1.0
        none = np.zeros((0, 0))
        self.run(none, np.zeros(0, dtype=np.int64), y0[None][:0])  # to compile it

    def run(
        self, table: Floats, places: Integers, y0: Floats, start: int = at.AS_IT_STANDS
    ) -> Found:
        """Run k points.

        Args:
            table: (k, w) numbers that differ from the model's.
            places: (w,) where they belong: in par, body and metric, one behind the other.
            y0: (k, n) states to start from.
            start: AS_IT_STANDS, CORRECTED first, or that ALONE (driver.py).
        """
        work, count = self.integration.work, len(table)
        nt, width = work.rows.shape
        found = np.zeros((count, at.COLUMNS))
        points = Points(
            at=np.array([0, 0, start], dtype=np.int64),
            places=np.ascontiguousarray(places, dtype=np.int64),
            table=np.ascontiguousarray(table, dtype=float),
            y0=np.array(y0, dtype=float),
            metric=self._metric,
            unit=self._unit,
            stops=self.stops,
            starting=self._told,
            rows=np.empty((count * nt, width)),
            found=found,
            **self.first,
        )
        problem = (self.machine.functions, _drives(), self._starting)
        system, loops = self.machine.system, self.machine.loops
        while True:
            with np.errstate(all="ignore"):  # as compiled code does
                run_points(points, work, *problem, system, loops, CALL)
            if points.at[at.POINT] == count:
                break
        if count:
            self.last_start = points.y0[-1]
        rows = points.rows.reshape(count, nt, width)
        done = found[:, at.ENDED] == Status.FINISHED
        return Found(done, rows, y0, points.y0, found)


@cache
def _starting(formulation: Formulation) -> Any:
    """What a run remembers of its start, and what brings it there, as compiled functions."""
    if not formulation.needs_joints:
        return step_functions(initial_state.begin_free)
    redundant = formulation.accepts_redundant
    begin = initial_state.begin_regularised if redundant else initial_state.begin_standard
    return step_functions(begin, initial_state.assemble_start)


@cache
def _drives() -> Any:
    """The integrator, by its address: compiled code that calls it has no copy of it."""
    return table_of(_DRIVE, (advance,))
