"""Words on steps that an implicit integration refused."""

import pytest
from support import problems
from support.internals import Refusals

import dap3d_core as dap
from dap3d_core.simulation.failure.stall import describe_refusals, refusal_notes


class Run:
    """An integration as far as the words need it."""

    name = "radau"

    def __init__(self, refusals, steps):
        self.refusals, self.statistics = refusals, self
        self.steps, self.rejected = steps, sum(refusals[:3]) if refusals else 0


@pytest.fixture(scope="module")
def evaluator():
    return dap.compile(problems.pendulum()).evaluator


def test_each_reason_has_its_count_and_the_iteration_its_component(evaluator):
    words = describe_refusals(evaluator, Run(Refusals(2, 5, 1, 8), 40))
    assert words == (
        "5 whose iteration for the stages did not converge (what changed most there, most often: "
        "the velocity of body bob), 1 whose matrix was singular, 2 for their error"
    )
    assert describe_refusals(evaluator, Run(Refusals(0, 0, 0, 0), 40)) == ""


def test_a_note_says_it_where_many_were_refused(evaluator):
    many, few = Run(Refusals(12, 0, 0, 0), 40), Run(Refusals(4, 5, 0, 0), 20)
    notes = refusal_notes(evaluator, [Run(None, 5), few, many])
    assert len(notes) == 1
    assert "radau refused 12 of 52 steps: 12 for their error" in notes[0]


def test_a_fixed_step_that_cannot_be_taken_says_why():
    """Ten times the length of a swing: the iteration does not converge."""
    with pytest.raises(
        dap.SimulationError,
        match=r"(?s)stopped at t = 0 s.*1 whose iteration for the stages did not conv",
    ):
        dap.simulate(problems.chain(2), t_end=50.0, dt=25.0, step=25.0, integrator="radau")
