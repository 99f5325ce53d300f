"""What a checkpoint holds matters: runs that are ended where the next step reads it."""

import itertools
from importlib import import_module

import numpy as np
import pytest
from support import mechanisms, problems, trees
from support.ended import leave, shorten_chunks
from support.internals import RadauState, read_checkpoint, store_reference_pivots
from support.levels import quickly
from support.plain import jit_is_on, long_in_plain_python
from support.results import same_run

import dap3d_core as dap

RUN = import_module("dap3d_core.simulation.run")


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch):
    shorten_chunks(monkeypatch)


@pytest.mark.slow
@long_in_plain_python
@pytest.mark.parametrize("integrator", quickly(["dop853", "adams", "radau"]))
def test_rows_that_wait_for_room_come_after_it(integrator, tmp_path, monkeypatch):
    """A row fills the buffer: the others of the step are interpolated when it goes on."""
    if integrator != "dop853" and not jit_is_on():
        pytest.skip("takes long in plain Python")
    monkeypatch.setattr(RUN, "BUFFER_NUMBERS", 1)
    settings = {"t_end": 1.0, "dt": 0.002, "integrator": integrator}
    whole = dap.simulate(problems.pendulum(), **settings)
    checkpoint = leave(problems.pendulum(), tmp_path, 0.5, **settings)
    header = read_checkpoint(checkpoint).header
    assert header["t"] > 0.002 * header["rows"]  # the next row lies in the step that is done
    assert same_run(dap.resume(checkpoint), whole)


def quarter_car():
    return dap.load("quarter_car")


@pytest.mark.slow
@pytest.mark.every(5)
@pytest.mark.skipif(not jit_is_on(), reason="takes long in plain Python")
@pytest.mark.parametrize(
    ("make", "has_factors"),
    [
        (quarter_car, True),
        (quarter_car, False),
        (mechanisms.door, False),  # its rows are regularised
    ],
)
def test_a_tangent_that_is_kept_for_the_next_step(make, has_factors, tmp_path):
    """It converged so fast; its factors are kept as well where the step stays as long.

    The first of some instants at which that is so: steps differ by the processor.
    """
    settings = {"t_end": 2.3, "dt": 0.2, "integrator": "radau"}
    for t in (0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.1, 1.3):
        (folder := tmp_path / f"{t}").mkdir()
        checkpoint = leave(make(), folder, t, **settings)
        arrays = read_checkpoint(checkpoint).arrays
        state = {
            name: arrays[f"0.{s.array}"][s.index]
            for name, s in RadauState.scalars.items()
            if s.array != "limits"
        }  # which holds where this call ends
        kept = state["factored_step"] == state["h"]
        if state["tangent_needed"] == 0 and kept == has_factors:
            break
    else:
        pytest.fail("none of these instants has such a tangent")
    assert same_run(dap.resume(checkpoint), dap.simulate(make(), **settings))


def paradox():
    """A light leaning disk that slides towards its contact: no load of it is in balance.
    Painleve's paradox, as in verification/test_friction.py."""
    lean, radius, J = np.pi / 4, 0.5, 0.005
    scene = dap.Scene(name="paradox")
    p = (np.cos(lean / 2), np.sin(lean / 2), 0.0, 0.0)
    scene.add_body("disk", mass=1.0, Jp=(J, J, J), p=p, r=(0.0, 0.0, radius * np.cos(lean)),
                   r_dot=(0.0, 1.0, 0.0))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="z", radius=radius)
    scene.add_force("weight")
    scene.add_force("friction", joint="contact", mu=3.0, v_tol=1e-3)
    return scene


def test_what_was_counted_before_is_told_at_the_end(tmp_path):
    """Multipliers did not settle with friction, before the run was ended and after."""
    settings = {"t_end": 0.02, "dt": 0.005, "integrator": "rk4", "step": 0.001}
    whole = dap.simulate(paradox(), **settings)
    found = dap.resume(leave(paradox(), tmp_path, 0.01, **settings))
    told = [note for note in whole.notes if "did not settle" in note]
    assert len(told) == 1
    assert told[0] in found.notes
    assert same_run(found, whole)


@pytest.mark.skipif(not jit_is_on(), reason="takes long in plain Python")
@pytest.mark.parametrize(
    ("make", "method"),
    [
        *itertools.product(
            [problems.four_bar, mechanisms.door, lambda: dap.load("A02-1")],
            ["auto", "lsq", "penalty"],
        ),
        (lambda: trees.random_tree(6, 2, free=0.2), "joint"),
    ],
)
def test_no_function_reads_what_another_has_left(make, method):
    """Of the model's arrays a checkpoint holds those alone that functions do not write anew."""
    compiled = dap.compile(make(), method=method)
    evaluator, u = compiled.evaluator, compiled.model.u0
    store_reference_pivots(evaluator, 0.0, u)
    evaluator.start(0.0, u)
    y, rng = evaluator.coordinates.start(u), np.random.default_rng(1)
    sizes = (y.size, 4 + evaluator.length_count, evaluator.report_size)  # of rhs, project, report

    def call(k, state, t):
        out, state = np.zeros(sizes[k]), state.copy()
        evaluator.functions[k](t, state, out, evaluator.system, evaluator.loops)
        return out.tobytes() + state.tobytes()

    for k in range(3):
        first = call(k, y, 0.1)
        for other in range(3):
            call(other, y + 1e-3 * rng.standard_normal(y.size), 0.3)
            assert call(k, y, 0.1) == first
