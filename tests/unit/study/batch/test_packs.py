"""Points that take their steps together: each within the tolerances of its single run."""

import numpy as np
import pytest
from support.on_axles import driven, stone, wheel
from support.plain import long_in_plain_python
from support.state_types import stated
from unit.study.batch.test_batch import ensemble, pendulum

import dap3d_core as dap
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.study import Ensemble, PointStatus
from dap3d_core.study.batch.packs import LaneLayout, packed


def in_packs(of, count):
    """The same ensemble with points in packs."""
    import attrs

    return Ensemble(attrs.evolve(of.study, pack=count))


def turning():
    """The wheel without what rubs."""
    scene = wheel()
    del scene.forces["rubbing"]
    return scene


#: Scene, varied numbers with their ranges, outputs.
CASES = {
    "masses": (pendulum, {"bodies.bob.mass": (1.0, 3.0), "bodies.bob.Jp.x": (0.1, 0.3)}, "bob.w"),
    "gravity, each its own": (pendulum, {"forces.gravity.gravity": (1.0, 20.0)}, "bob.r:max"),
    "starts that are corrected": (pendulum, {"points.A.sPp.y": (0.9, 1.1)}, "bob.r:series"),
    "springs in free flight": (stone, {"forces.spring.k": (1.0, 9.0)}, "stone.r"),
    "multipliers": (pendulum, {"forces.gravity.gravity": (1.0, 20.0)}, "pivot.lambda"),
    "turns": (turning, {"forces.spring.k": (1.0, 3.0)}, "wheel.w.z:series"),
    "states of elements": (
        stated,
        {"forces.spring.z_0": (0.0, 0.3), "forces.loop.beta": (1.0, 3.0)},
        "loop.z:series",
    ),
    "functions and their breaks": (driven, {"bodies.crank.Jp.z": (0.5, 1.5)}, "motor.lambda:max"),
}


@long_in_plain_python
@pytest.mark.parametrize("case", CASES)
def test_packs_give_what_single_runs_give(case):
    """Both are off by some rtol of 1e-8 a step; over some 50 steps 1e-6 of the size is allowed."""
    make, vary, output = CASES[case]
    of = ensemble(make(), vary, [output], t_end=1.0, dt=0.1)
    fractions = np.random.default_rng(1).random((7, len(vary)))
    low, high = np.array(list(vary.values())).T
    points = low + fractions * (high - low)
    single, together = of.run(points), in_packs(of, 3)
    batch = together.run(points)
    assert together._runner().packed is not None
    assert batch.status.tolist() == [PointStatus.DONE] * 7
    assert batch.notes == single.notes
    differ = False
    for name, values in single.values.items():
        size = np.max(np.abs(values))
        np.testing.assert_allclose(batch.values[name], values, rtol=0.0, atol=1e-6 * size)
        differ |= bool(np.ptp(values, axis=0).max() > 1e-3 * size)
    assert differ  # else it would not matter whose numbers a point was given


@long_in_plain_python
def test_a_pack_that_fails_is_run_point_by_point():
    of = ensemble(stone(), ["forces.spring.k"], ["stone.r.z"], t_end=2.0, dt=2.0)
    points = [[1.0], [-1e5], [2.0], [3.0], [4.0]]
    batch, single = in_packs(of, 2).run(points), of.run(points)
    assert batch.status.tolist() == [1, 2, 1, 1, 1]
    assert "beyond 1e+100" in batch.notes[1]
    good = [0, 4]  # of the broken pack, and the one that fills none: these are single runs
    assert np.array_equal(batch.values["stone.r.z"][good], single.values["stone.r.z"][good])


@pytest.mark.parametrize(
    ("make", "name", "output"),
    [
        (pendulum, "bodies.bob.mass", "energy.total"),
        (pendulum, "bodies.bob.mass", "energy.potential:max"),
        (pendulum, "bodies.bob.mass", "work"),
        (pendulum, "bodies.bob.mass", "constraint.position:max"),
        (wheel, "forces.rubbing.mu", "wheel.w.z"),
    ],
)
def test_what_copies_would_share_is_not_run_in_packs(make, name, output):
    of = in_packs(ensemble(make(), [name], [output], t_end=0.01, dt=0.01), 2)
    of.run([[0.2]])
    assert of._runner().packed is None


def test_copies_have_the_rates_of_the_single_model():
    """Two pendulums of different pose side by side: right-hand side and report, to rounding."""
    compiled = dap.compile(pendulum())
    one, count = compiled.new_evaluator(), 3
    many = Evaluator(packed(compiled.model, count), compiled.method)
    lanes = LaneLayout(one, many, count)
    rng = np.random.default_rng(2)
    states = np.array([one.integrated(compiled.model.u0) for _ in range(count)])
    states[:, 7:13] += 0.1 * rng.random((count, 6))
    joined = lanes.join(states[None])[0]
    rates, report = np.zeros_like(joined), np.zeros(many.report_size)
    many.functions[0](0.0, joined, rates, many.system, many.loops)
    many.functions[2](0.0, joined, report, many.system, many.loops)
    rows = np.concatenate([[0.0], rates, report])[None, None]
    for k, state in enumerate(states):
        own, own_report = np.zeros_like(state), np.zeros(one.report_size)
        one.functions[0](0.0, state, own, one.system, one.loops)
        one.functions[2](0.0, state, own_report, one.system, one.loops)
        found = lanes.rows_of(rows)[0, k, 0]
        np.testing.assert_allclose(found[1:14], own[:-1], rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(found[15:-4], own_report[:-4], rtol=1e-13, atol=1e-13)
