"""The arrays of a system as symbols: which numbers are constants, and what is stored."""

import numpy as np
import pytest
from support.internals import MASS, Item, StraightLine, Symbol, scene_program

import dap3d_core as dap
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, constants
from dap3d_core.integrators import EXPLICIT


@pytest.fixture(scope="module")
def evaluator():
    """Of a scene with angles whose turns are counted, in joint coordinates."""
    return dap.compile("fourbar3", method="joint").evaluator


def test_counted_turns_are_no_constants(evaluator):
    """Nor is what a run counts; masses are."""
    places = dict(constants(evaluator))
    counted = [k for s in evaluator.turn_places() for k in range(*s.indices(10**6))]
    assert counted
    assert not set(counted) & set(places["par"].tolist())
    body = set(places["body"].tolist())
    width = evaluator.system.body.shape[1]
    assert width + MASS in body
    assert width not in body


@pytest.mark.parametrize(("model", "method"), [("fourbar3", "joint"), ("A02-1", "lsq")])
def test_no_run_changes_a_constant(model, method):
    """Steps, projections and reports of general code leave them: programs fit the next call."""
    evaluator = dap.compile(model, method=method).evaluator
    y0 = evaluator.coordinates.start(evaluator.model.u0)
    evaluator.start(0.0, evaluator.model.u0)
    parts = scene_program.constant_parts(evaluator)
    before = scene_program.constant_numbers(parts)
    options = {"report_size": evaluator.report_size, "project_on": True}
    integration = EXPLICIT.make(evaluator, y0, np.array([0.0, 0.02]), **options)
    integration.advance(10**6)
    assert integration.statistics.projections > 0
    assert scene_program.constant_numbers(parts) == before


def test_arrays_that_share_memory_share_symbols(evaluator):
    """The bodies of a tree are its first places."""
    struct = SymbolicSystem(evaluator, StraightLine(1000)).struct
    struct.body[1, 0] = 5.0
    assert struct.tree.places[1, 0] == 5.0
    assert isinstance(struct.body[1, 1], Item)
    assert isinstance(struct.body[1, MASS], float)
    assert struct.nodes is evaluator.system.nodes


def test_only_what_outlives_an_evaluation_is_stored(evaluator):
    """A count of the run, not scratch."""
    tracer = StraightLine(1000)
    system = SymbolicSystem(evaluator, tracer)
    system.struct.force[0] = 1.0
    assert system.stores() == []
    system.struct.settings[3] += 1.0
    [(pointer, k, x)] = system.stores()
    assert k == 3
    assert isinstance(x, Symbol)
    assert pointer() in "\n".join(tracer.lines)
    assert np.array_equal(evaluator.system.settings[3], 0.0)
