"""What was computed until an exception is carried by the exception."""

from pathlib import Path

import dap3d_core as dap
from dap3d_core.result import Computed, ResultError


def test_any_exception_carries_what_was_computed():
    error = KeyboardInterrupt()
    assert Computed.of(error).result is None
    Computed("rows").attach(error)
    Computed(checkpoint=Path("a.checkpoint")).attach(error)
    assert (error.result, error.checkpoint) == ("rows", Path("a.checkpoint"))
    found = Computed.of(error)
    assert (found.result, found.checkpoint, found.part) == ("rows", error.checkpoint, None)


def test_nothing_that_is_carried_is_lost():
    error = dap.SimulationError("stopped", "rows")
    Computed(part=Path("a.part")).attach(error)
    assert (Computed.of(error).result, error.part) == ("rows", Path("a.part"))
    assert Computed.of(ResultError("full")).part is None


def test_an_exception_with_slots_ends_as_it_is():
    class Slotted(Exception):
        def __setattr__(self, name, value):
            raise AttributeError(name)

    error = Slotted()
    Computed("rows").attach(error)
    assert Computed.of(error).result is None
