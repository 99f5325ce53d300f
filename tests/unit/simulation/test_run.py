"""Notes of one run."""

import pytest
from support import problems

import dap3d_core as dap
from dap3d_core.simulation import run


@pytest.mark.parametrize(
    ("method", "work", "is_noted"),
    [("auto", 1, True), ("auto", run.MUCH_WORK, False), ("standard", 1, False)],
)
def test_a_long_run_whose_method_was_left_open_says_that_joint_is_quicker(
    method, work, is_noted, monkeypatch
):
    """A chain of ten rods; neither a short run nor one whose method was chosen has the note."""
    monkeypatch.setattr(run, "MUCH_WORK", work)
    result = dap.simulate(problems.chain(10), t_end=0.01, dt=0.01, method=method)
    assert any("method joint would take some 0." in note for note in result.notes) == is_noted
