"""When runs of a scene change over from the general right-hand side to a program of its own.

General code runs until it has taken about as long as a program takes to make; then one is made, or
loaded from the cache folder. It stands in the table of functions during a call of the integrator
alone, and only where the numbers that are its constants are those of the scene.
"""

import threading
import time
from typing import TYPE_CHECKING, Any

import attrs

from dap3d_core.formulations import PROJECT, REPORT, RHS, WATCH
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.background import optimiser
from dap3d_core.kernels.runtime.cache import jit_is_on

if TYPE_CHECKING:
    from collections.abc import Callable

    from dap3d_core.formulations.programs.symbolic_arrays import Varied
    from dap3d_core.kernels.array_types import Floats, Integers

    Start = Callable[[], tuple[float, Floats]]

#: Seconds in general code from which on a program is looked for in the cache folder, and made.
LOAD_AFTER, MAKE_AFTER = 0.02, 0.25
#: Those from which on the process that compiles them starts, to be there when one is written.
START_AFTER = 0.15
#: Whether another process compiles programs where it can, so that the run goes on.
BESIDE = True
#: Bodies of a scene at most: the program of a larger one would be too long.
MOST_BODIES = 64
#: Programs whose guards fail more often are given up: by the function, as parts of the right-hand
#: sides, or projections, of the call.
MOST_FAILURES = {WATCH: 0.5, PROJECT: 0.5, REPORT: 0.5, RHS: 0.05}
#: Reports for each right-hand side from which on they have a program.
LEAST_REPORTS = 0.02
#: At most, where projections take one way: made anew they take all.
MOST_OF_ONE_WAY = 0.2


@attrs.define
class Record:
    """What is known of the scenes of one name.

    Attributes:
        programs: as ``load_programs`` returns them; empty as long as there are none.
        reason: why there are none and will be none; "" while there may be.
        is_due: True if they are to be made, or made anew: those that there are run until then.
        is_requested: True if they are being compiled by another process.
        takes_all_ways: True if projections do (ways.py).
        first: where the first ones were made here, if projections alone have failed since.
        anew: time and state at which they are made anew, as guards of the first ones failed.
    """

    programs: dict[int, Any] = attrs.field(factory=dict)
    reason: str = ""
    is_due: bool = True
    is_requested: bool = False
    takes_all_ways: bool = False
    first: "tuple[float, Floats] | None" = None
    anew: "tuple[float, Floats] | None" = None


#: Seconds that general code has taken, by a rough description of the scene, and whether it reported
#: often; records by identity. Seconds that scenes have lost where no program came of it: contacts
#: in other modes have to take as long before another is tried.
_spent: dict[Any, float] = {}
_lost: dict[Any, float] = {}
_reported: dict[Any, bool] = {}
_records: dict[str, Record] = {}
#: Held while a program is made, as several threads may need it at once.
_making = threading.Lock()


class ChangeOver:
    """The programs of an evaluator, for its integrations."""

    def __init__(self, evaluator: Any, varied: "Varied" = None, count: int = 1) -> None:
        """Args:
        evaluator: whose functions programs stand for.
        varied: numbers that differ from run to run, or have derivatives (symbolic_arrays.py).
        count: numbers for each float of the functions: more than one where they are differentiated.
        """
        model = evaluator.model
        self._evaluator, self._varied, self._count = evaluator, varied, count
        #: Names of the programs, by modes of contacts, and whether projections are alone.
        self._names: dict[Any, str] = {}
        #: Constants of the programs: where they stand, and their numbers.
        self._parts: list[tuple[Floats, Integers]] = []
        self._constants = b""
        sizes = model.body_count, model.row_count, len(evaluator.loop_groups)
        self._key = evaluator.method, *sizes, count
        takes_one = not model.breaks and (varied is None or not model.contact_count)
        #: Contacts are read where a report has placed them; programs of reports leave nothing.
        self._takes_reports = count == 1 and not model.contact_count
        self._is_open = jit_is_on() and takes_one and 0 < model.body_count <= MOST_BODIES
        #: Steps of a fixed length project what they end at before they evaluate it.
        self._projects_alone = False

    def during(self, integration: Any, run: "Callable[[], object]") -> None:
        """Advance an integration, which ``run`` does, by programs where there are some.

        What else it does changes no number of the scene but inputs.
        """
        work = integration.work

        def counts() -> tuple[int, int, int]:
            return work.rhs_count, work.projection_count, work.report_count

        def start() -> "tuple[float, Floats]":
            state, of_elements = integration.trial, slice(-1 - self._evaluator.states.size, -1)
            state[of_elements] = integration.y[of_elements]
            return integration.t, state

        if self._is_open and integration.takes_programs:
            self._projects_alone = work.fixed_step != 0.0
            self.call(run, self._evaluator.functions.addresses, start, counts)
        else:
            run()

    def call(
        self,
        run: "Callable[[], object]",
        addresses: "Integers",
        start: "Start",
        counts: "Callable[[], tuple[int, int, int]]",
        *,
        needs_programs: bool = False,
    ) -> None:
        """Make a call that evaluates the scene, by programs where there are some.

        Kernels are compiled here.

        Args:
            run: the call.
            addresses: of the functions that it calls.
            start: gives a time, and a state as projections are given, where these are needed.
            counts: right-hand sides, projections and reports so far.
            needs_programs: do not make it without them.
        """
        modes = self._modes(start)
        record = self._record_of(modes, start)
        # taken at once, as another thread may give them up
        programs = None if record is None else record.programs
        if record is None or not programs:
            if needs_programs:
                return
            clock = time.perf_counter()
            run()
            _spent[modes] = _spent.get(modes, 0.0) + time.perf_counter() - clock
            _reported[modes] = counts()[REPORT] >= LEAST_REPORTS * counts()[RHS]
            return
        general, done = addresses.copy(), counts()
        replaced = [(k, programs[k]) for k in MOST_FAILURES if k in programs]
        failures = [program.failures() for _, program in replaced]
        for k, program in replaced:
            addresses[k] = program.address
        try:
            run()
        finally:
            addresses[:] = general
        called = [after - before for after, before in zip(counts(), done, strict=True)]
        is_first = record.anew is None
        for (k, program), before in zip(replaced, failures, strict=True):
            is_final = record.takes_all_ways or record.anew is not None
            most = MOST_FAILURES[k] if is_final else min(MOST_FAILURES[k], MOST_OF_ONE_WAY)
            most *= called[RHS if k == WATCH else k]
            if program.failures() - before > 1 + most:
                _give_up(record, program, k, start())
                if is_first:
                    break

    def _modes(self, start: "Start") -> Any:
        """A rough description of the scene, with the modes of its contacts."""
        if not (self._is_open and self._evaluator.model.contact_count):
            return self._key
        from dap3d_core.formulations.programs.contact_modes import mode_states

        return self._key, *(array.tobytes() for array in mode_states(self._evaluator, start()[1]))

    def _record_of(self, modes: Any, start: "Start") -> Record | None:
        """The record, where this call may run its programs."""
        if not self._is_open or _spent.get(modes, 0.0) < LOAD_AFTER:
            return None
        from dap3d_core.formulations.programs import scene_program

        if not self._parts:
            if not scene_program.is_optimised(self._evaluator):
                return None
            self._parts = scene_program.constant_parts(self._evaluator, self._varied)
            self._constants = scene_program.constant_numbers(self._parts)
        if self._constants != scene_program.constant_numbers(self._parts):
            return None
        key = modes, self._projects_alone
        name = self._names.get(key)
        if name is None:
            of = start()[1].size, self._constants + repr(modes).encode(), self._varied
            name = scene_program.name_of(self._evaluator, *of)
            if self._projects_alone and scene_program.reads_rates(self._evaluator):
                name += scene_program.ALONE
            if self._takes_reports and _reported.get(modes, False):
                name += scene_program.REPORTS
            self._names[key] = name
        record = _records.get(name)
        if record is not None and not record.is_due:
            return record if record.programs else None
        with _making:
            record = _records.setdefault(name, Record())
            if record.is_due:
                clock = time.perf_counter()
                try:
                    self._make(record, name, modes, start)
                except Exception as error:  # the general code runs on, whatever it was
                    lost = _lost.get(self._key, 0.0) + time.perf_counter() - clock
                    _lost[self._key], record.is_due = lost, False
                    record.reason = f"{type(error).__name__}: {error}"
        return record if record.programs else None

    def _make(self, record: Record, name: str, modes: Any, start: "Start") -> None:
        """Load programs that the cache folder has, or let them be compiled."""
        from dap3d_core.formulations.programs import scene_program

        evaluator, path = self._evaluator, scene_program.path_of(name)
        if path is not None and record.anew is not None and not record.is_requested:
            path.unlink(missing_ok=True)
        stored = None if path is None else objects.read_object(path)
        if stored is None:
            spent = _spent.get(modes, 0.0)
            if record.is_requested or spent < max(MAKE_AFTER, _lost.get(self._key, 0.0)):
                if spent > START_AFTER and BESIDE and path is not None:
                    optimiser.start()
                return
            place, others = record.first or record.anew or start(), None
            if record.anew is None:
                record.first = place
            else:
                others = (record.anew[1],)
            text, written = scene_program.write_programs(
                evaluator, name, *place, self._varied, others, self._count
            )
            if BESIDE and path is not None and optimiser.request(text, written, path):
                record.is_requested = True
                return
            stored = written, objects.optimised(text, written, path)
        record.takes_all_ways = scene_program.ALL_WAYS in stored[0]
        record.programs = scene_program.load_programs(evaluator, name, *stored)
        record.is_due = False


def _give_up(record: Record, program: Any, k: int, place: "tuple[float, Floats]") -> None:
    """Take other code from here on where guards of a program fail too often.

    First programs made at a state as they are now, whose branches may be others: those of a
    projection, which then takes all ways, follow from the tolerances. Then general code; of a
    projection the general one behind a right-hand side of its own: one alone would read what
    programs of right-hand sides do not leave.
    """
    with _making:
        if record.programs.get(k) is not program:  # another thread was faster
            return
        others = {q: one for q, one in record.programs.items() if q != k}
        if k == PROJECT:
            from dap3d_core.formulations.programs.scene_program import BEHIND

            others[PROJECT] = others.pop(BEHIND, program)
        record.programs = {} if k == RHS else others
        if record.anew is None:
            record.anew, record.is_due, record.is_requested = place, True, False
            record.first = record.first if k == PROJECT else None
        elif k == RHS:
            record.is_due, record.reason = False, "guards fail: branches depend on the motion"
