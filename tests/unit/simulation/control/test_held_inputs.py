"""Inputs of a run, set by name."""

import pytest
from support.pushed import pushed_block

import dap3d_core as dap
from dap3d_core.simulation.control.held_inputs import HeldInputs


def test_changes_are_told_and_stand_in_the_arrays():
    """An equal value is no change; all is refused before anything of it is wrong."""
    evaluator = dap.compile(pushed_block(0.25)).evaluator
    inputs = HeldInputs(evaluator)
    assert not inputs.set({"push": 0.25})
    assert inputs.set({"push": 1})
    assert evaluator.inputs.tolist() == [1.0] == inputs.values
    with pytest.raises(ValueError, match="should be a finite number"):
        inputs.set({"push": float("inf")})
    assert evaluator.inputs.tolist() == [1.0]
    assert not inputs.drives
