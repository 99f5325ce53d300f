"""When runs of a scene change over from the general right-hand side to a program of its own.

General code runs until it has taken about as long as a program takes to make; then one is made, or
loaded from the cache folder. It stands in the table of functions during a call of the integrator
alone, and only where the numbers that are its constants are those of the scene.
"""

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations import PROJECT, RHS
from dap3d_core.kernels.runtime.cache import jit_is_on

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator
    from dap3d_core.integrators.stepping.integration import Integration
    from dap3d_core.kernels.array_types import Floats

#: Seconds in general code from which on a program is looked for in the cache folder, and made.
LOAD_AFTER, MAKE_AFTER = 0.02, 0.25
#: Bodies of a scene at most: the program of a larger one would be too long.
MOST_BODIES = 64
#: A program whose guards fail in more than this part of its evaluations is given up.
MOST_FAILURES = 0.05


@attrs.frozen
class Program:
    """A loaded program.

    Attributes:
        addresses: of right-hand side and projection.
        failures: evaluations at which a guard failed, so far.
    """

    addresses: tuple[int, int]
    failures: Callable[[], int]


@attrs.define
class Record:
    """What is known of the scenes of one program.

    Attributes:
        program: the program, once there is one.
        reason: why there is none and will be none; "" while there may be.
    """

    program: Program | None = None
    reason: str = ""


#: Seconds that general code has taken, by a rough description of the scene; records by identity.
_spent: dict[Any, float] = {}
_records: dict[str, Record] = {}
#: Held while a program is made, as several threads may need it at once.
_making = threading.Lock()


class ChangeOver:
    """The program of an evaluator, for its integrations.

    Attributes:
        record: what is known of it; None until general code has taken a while.
    """

    def __init__(self, evaluator: "Evaluator") -> None:
        """Args: the evaluator."""
        model = evaluator.model
        self.record: Record | None = None
        self._evaluator, self._numbers = evaluator, np.zeros(0)
        self._key = evaluator.method, model.body_count, model.row_count, len(evaluator.loop_groups)
        self._is_open = jit_is_on() and 0 < model.body_count <= MOST_BODIES

    def advance(self, integration: "Integration", budget: int) -> None:
        """``integration.advance``, by the program where there is one."""
        program = self._program(integration) if self._is_open else None
        if program is None:
            clock = time.perf_counter()
            integration.advance(budget)
            _spent[self._key] = _spent.get(self._key, 0.0) + time.perf_counter() - clock
            return
        addresses = integration.functions.addresses
        general, failures = addresses[[RHS, PROJECT]].copy(), program.failures()
        count = integration.statistics.rhs
        addresses[[RHS, PROJECT]] = program.addresses
        try:
            integration.advance(budget)
        finally:
            addresses[[RHS, PROJECT]] = general
        failed, count = program.failures() - failures, integration.statistics.rhs - count
        if self.record is not None and failed > 1 + MOST_FAILURES * count:
            self.record.program = None
            self.record.reason = f"{failed} of {count} evaluations took another branch"

    def _program(self, integration: "Integration") -> Program | None:
        """The program, where this call may run it."""
        spent = _spent.get(self._key, 0.0)
        if spent < LOAD_AFTER or not integration.takes_programs:
            return None
        from dap3d_core.formulations.programs import scene_program

        if self.record is None:
            if not scene_program.is_optimised(self._evaluator):
                return None
            self._numbers = scene_program.constant_numbers(self._evaluator)
            self._name = scene_program.name_of(self._evaluator, integration.y.size, self._numbers)
            self.record = _records.setdefault(self._name, Record())
        record = self.record
        if record.reason or not np.array_equal(
            self._numbers, scene_program.constant_numbers(self._evaluator)
        ):
            return None
        with _making:
            if record.program is None and not record.reason:
                is_kept = scene_program.is_kept(self._name)
                if is_kept or spent >= MAKE_AFTER:
                    _make(record, self._name, self._evaluator, integration)
        return record.program


def _make(record: Record, name: str, evaluator: "Evaluator", integration: "Integration") -> None:
    from dap3d_core.formulations.programs import scene_program

    try:
        addresses, failures = scene_program.made(name, evaluator, integration.t, integration.y)
    except (TypeError, ValueError, ArithmeticError) as error:
        record.reason = str(error)
        return
    record.program = Program(addresses, failures)
