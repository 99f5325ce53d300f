"""When runs of a scene change over from the general right-hand side to a program of its own.

General code runs until it has taken about as long as a program takes to make; then one is made, or
loaded from the cache folder. It stands in the table of functions during a call of the integrator
alone, and only where the numbers that are its constants are those of the scene.
"""

import threading
import time
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations import PROJECT, RHS
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
#: Whether another process compiles programs where it can, so that the run goes on.
BESIDE = True
#: Bodies of a scene at most: the program of a larger one would be too long.
MOST_BODIES = 64
#: Programs of right-hand sides and projections whose guards fail more often are given up.
MOST_FAILURES = (0.05, 0.5)


@attrs.define
class Record:
    """What is known of the scenes of one name.

    Attributes:
        programs: of right-hand side and projection, as ``load_programs`` returns them; empty
            as long as there are none.
        reason: why there are none and will be none; "" while there may be.
        is_requested: True if they are being compiled by another process.
        is_anew: True once they were made anew, as guards of the first ones failed.
    """

    programs: list[Any] = attrs.field(factory=list)
    reason: str = ""
    is_requested: bool = False
    is_anew: bool = False


#: Seconds that general code has taken, by a rough description of the scene; records by identity.
_spent: dict[Any, float] = {}
_records: dict[str, Record] = {}
#: Held while a program is made, as several threads may need it at once.
_making = threading.Lock()


class ChangeOver:
    """The programs of an evaluator, for its integrations."""

    def __init__(self, evaluator: Any, varied: "Varied" = None) -> None:
        """Args: the evaluator; numbers that differ from run to run (symbolic_arrays.py)."""
        model = evaluator.model
        self._evaluator, self._varied = evaluator, varied
        self._name: str | None = None
        #: Constants of the programs: where they stand, and their numbers.
        self._parts: list[tuple[Floats, Integers]] = []
        self._numbers: Floats = np.zeros(0)
        self._key = evaluator.method, model.body_count, model.row_count, len(evaluator.loop_groups)
        takes_one = not model.contact_count  # their friction is solved for, in passes
        self._is_open = jit_is_on() and takes_one and 0 < model.body_count <= MOST_BODIES

    def advance(self, integration: Any, budget: int) -> None:
        """``integration.advance``, by programs where there are some."""

        def counts() -> tuple[int, int]:
            now = integration.statistics
            return now.rhs, now.projections

        def run() -> None:
            integration.advance(budget)

        if self._is_open and integration.takes_programs:
            addresses = integration.functions.addresses
            self.call(run, addresses, lambda: (integration.t, integration.trial), counts)
        else:
            run()

    def call(
        self,
        run: "Callable[[], None]",
        addresses: "Integers",
        start: "Start",
        counts: "Callable[[], tuple[int, int]]",
        *,
        needs_programs: bool = False,
    ) -> None:
        """Make a call that evaluates the scene, by programs where there are some.

        Kernels are compiled here.

        Args:
            run: the call.
            addresses: of the functions that it calls.
            start: gives a time, and a state as projections are given, where these are needed.
            counts: right-hand sides and projections so far.
            needs_programs: do not make it without them.
        """
        record = self._record_of(start)
        # taken at once, as another thread may give them up
        programs = [] if record is None else record.programs[: PROJECT + 1]
        if record is None or not programs:
            if needs_programs:
                return
            clock = time.perf_counter()
            run()
            _spent[self._key] = _spent.get(self._key, 0.0) + time.perf_counter() - clock
            return
        general = addresses[: len(programs)].copy()
        failures, done = [program.failures() for program in programs], counts()
        addresses[: len(programs)] = [program.address for program in programs]
        try:
            run()
        finally:
            addresses[: len(programs)] = general
        now = counts()
        for k in reversed(range(len(programs))):
            if programs[k].failures() - failures[k] > 1 + MOST_FAILURES[k] * (now[k] - done[k]):
                _give_up(record, programs[k], k)

    def _record_of(self, start: "Start") -> Record | None:
        """The record, where this call may run its programs."""
        if not self._is_open or _spent.get(self._key, 0.0) < LOAD_AFTER:
            return None
        from dap3d_core.formulations.programs import scene_program

        if self._name is None:
            if not scene_program.is_optimised(self._evaluator):
                return None
            self._parts = scene_program.constant_parts(self._evaluator, self._varied)
            self._numbers = scene_program.constant_numbers(self._parts)
            size = start()[1].size
            self._name = scene_program.name_of(self._evaluator, size, self._numbers, self._varied)
        if not np.array_equal(self._numbers, scene_program.constant_numbers(self._parts)):
            return None
        with _making:
            record = _records.setdefault(self._name, Record())
            if not (record.programs or record.reason):
                try:
                    self._make(record, self._name, start)
                except Exception as error:  # the general code runs on, whatever it was
                    record.reason = f"{type(error).__name__}: {error}"
        return record if record.programs else None

    def _make(self, record: Record, name: str, start: "Start") -> None:
        """Load programs that the cache folder has, or let them be compiled."""
        from dap3d_core.formulations.programs import scene_program

        evaluator, path = self._evaluator, scene_program.path_of(name)
        if path is not None and record.is_anew and not record.is_requested:
            path.unlink(missing_ok=True)
        stored = None if path is None else objects.read_object(path)
        if stored is None:
            if record.is_requested or _spent.get(self._key, 0.0) < MAKE_AFTER:
                return
            text = scene_program.write_programs(evaluator, name, *start(), self._varied)
            if BESIDE and path is not None and optimiser.request(text, [], path):
                record.is_requested = True
                return
            stored = [], objects.optimised(text, [], path)
        record.programs = scene_program.load_programs(evaluator, name, stored[1])


def _give_up(record: Record, program: Any, k: int) -> None:
    """Take other code from here on where guards of a program fail too often.

    First programs of a state as they are now, whose branches may be others: those of a
    projection follow from the tolerances. Then general code; of a projection the general one
    behind a right-hand side of its own, which moves up: one alone would read what programs of
    right-hand sides do not leave.
    """
    with _making:
        if program not in record.programs:  # another thread was faster
            return
        if not record.is_anew:
            record.programs, record.is_anew, record.is_requested = [], True, False
        elif k == RHS:
            record.programs, record.reason = [], "guards fail: branches depend on the motion"
        else:
            record.programs = [one for one in record.programs if one is not program]
