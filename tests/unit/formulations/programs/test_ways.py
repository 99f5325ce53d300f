"""Projections that take any way: with passes for positions and velocities, for these, for none."""

import numpy as np
import pytest
from support.internals import compiled, objects, off_constraints, scene_program
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.formulations import OUTCOMES, PROJECT

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


@compiled
def project_behind(functions, y, rates, out, system, loops):
    """Project y, whose rates are evaluated before."""
    rhs, project = functions[0], functions[1]
    rhs(0.0, y, rates, system, loops)
    out[0] = 1.0
    project(0.0, y, out, system, loops)


@pytest.mark.parametrize(
    ("model", "method", "first_rate", "others", "failures"),
    [
        ("pen1", "standard", 7, None, 2),
        ("pen1", "standard", 7, (), 0),
        ("fourbar2", "joint", 2, (), 0),
    ],
)
def test_bits_are_those_of_general_code(model, method, first_rate, others, failures):
    """At states of each way; without all ways guards of the others fail."""
    evaluator = dap.compile(model, method=method).new_evaluator()
    evaluator.start(0.0, evaluator.model.u0)
    functions, other = evaluator.functions, (evaluator.system, evaluator.loops)

    def projected(y):
        y, out = y.copy(), np.zeros(OUTCOMES + evaluator.length_count)
        project_behind(functions, y, np.zeros_like(y), out, *other)
        return y, out

    off = off_constraints(evaluator.coordinates.start(evaluator.model.u0))
    on = projected(projected(off)[0])[0]
    states = off, np.where(np.arange(off.size) < first_rate, on, off), on
    general = [projected(y) for y in states]
    assert [out[0] for _, out in general] == [1.0, 1.0, 0.0]

    name = f"{model}_{method}_{failures}"
    text, written = scene_program.write_programs(evaluator, name, 0.0, off, others=others)
    programs = scene_program.load_programs(
        evaluator, name, written, objects.optimised(text, written, None)
    )
    functions.addresses[PROJECT] = programs[PROJECT].address
    for y, (state, outcome) in zip(states, general, strict=True):
        found, out = projected(y)
        assert np.array_equal(found, state)
        assert np.array_equal(out, outcome)
    assert programs[PROJECT].failures() == failures
