"""Where steps end for the sake of a singular state ahead, and that a run may be cut there."""

import numpy as np
import pytest
from support import redundant
from support.internals import MEASURES, store_reference_pivots
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.integrators import TABLEAUS, RungeKutta, Status
from dap3d_core.integrators.stepping.singular_poses import (
    NOW,
    RATE,
    SLOPE,
    is_near_singularity,
    limit_step_at_singularity,
    record_singularity,
    update_measures,
)


def state_of(*pairs, gap=0.5):
    """State with (measure, rate) of each node, and the middle of the widest gap."""
    run = RungeKutta(TABLEAUS["dop853"], [], (), (), [0.0], [0.0, 1.0], length_count=len(pairs))
    run.work.lengths[[NOW, RATE]] = np.transpose(pairs)
    run.work.widest_gap_abscissa = gap
    return run.work


@pytest.mark.parametrize("gap", [0.25, 7 / 15, 0.55])
def test_the_step_across_has_the_singular_state_in_its_gap(gap):
    """From any distance: no step is longer than allowed or ends close to the singular state, and
    the one across has it at ``gap``, exactly. 2.5 steps away it is crossed by the fifth."""
    h = 1.0
    for begin in np.linspace(0.02, 2.5, 40):
        left, step, count = begin, 0.0, 0
        while step <= left:
            left -= step
            assert count == 0 or left >= 0.9 * gap * h, begin
            step = limit_step_at_singularity(state_of((2.0 * left, -2.0), (1.0, 0.1), gap=gap), h)
            assert 0.0 < step <= h, begin
            count += 1
            assert count <= 5, begin
        assert left / step == pytest.approx(gap, rel=1e-12), begin


def test_nothing_ahead_leaves_the_step_alone():
    """Rates that are zero, positive or unknown, and a state far away."""
    for pair in ((1.0, 0.0), (1.0, 3.0), (np.nan, np.nan), (1.0, -0.1)):
        assert limit_step_at_singularity(state_of(pair), 1.0) == 1.0
        assert not is_near_singularity(state_of(pair), 0.1)


def test_lengths_count_from_the_far_side_after_a_crossing():
    """They turn round at zero: -0.2 -> 0.3 is a rate of 0.5, and of the row
    that did not cross -0.1."""
    state = state_of((0.2, -0.5), (1.0, -0.1))
    state.real[MEASURES:] = 0.3, 0.9
    update_measures(state, 1.0)
    assert state.lengths[NOW] == pytest.approx([0.3, 0.9])
    assert state.lengths[RATE] == pytest.approx([0.5, -0.1])


@pytest.mark.parametrize(("linear", "square"), [(1.0, 0.0), (0.4, 1.3), (0.0, 2.0)])
def test_a_measure_that_falls_ever_slower_is_prolonged_by_its_parabola(linear, square):
    """a d + b d^2 at d = 3, 2.4, 1.5, at one unit of d in a second: 1.5 s are left."""
    state = state_of((np.nan, np.nan))
    for distance, h in ((3.0, 1.0), (2.4, 0.6), (1.5, 0.9)):
        state.real[MEASURES:] = linear * distance + square * distance**2
        update_measures(state, h)
    left = -state.lengths[NOW, 0] / state.lengths[RATE, 0]
    assert left == pytest.approx(1.5, rel=1e-7)  # a double root is known to the root of rounding


def test_a_step_before_the_one_across_does_not_reach_the_singular_state():
    """Where the measure is steeper than its mean rate says, the estimate is as likely too long."""
    state = state_of((2.0, -1.0))
    state.lengths[SLOPE] = -2.0
    assert limit_step_at_singularity(state, 1.5) == pytest.approx(0.5)


def test_a_stage_on_the_singular_state_tells_when_it_is():
    """Seen from 1 unit away: at 0.01 it is there, at 0.1 it is not."""
    state = state_of((1.0, -0.2))
    state.lengths[SLOPE] = -0.2
    state.real[MEASURES:] = 0.1
    assert not record_singularity(state, 2.0)
    state.real[MEASURES:] = 0.01
    assert record_singularity(state, 2.0)
    assert limit_step_at_singularity(state, 5.0) == pytest.approx(4.0)
    state.real[MEASURES:] = 0.5
    update_measures(state, 0.5)
    assert state.lengths[RATE] == pytest.approx([-0.5 / 1.5])  # as the stage has told


def test_the_middle_of_the_widest_gap():
    """By hand from the tableaux: 1/3 to 3/5, 3/10 to 4/5."""
    assert TABLEAUS["dop853"].widest_gap_abscissa == pytest.approx((1 / 3 + 3 / 5) / 2)
    assert TABLEAUS["dopri5"].widest_gap_abscissa == pytest.approx((3 / 10 + 4 / 5) / 2)


@long_in_plain_python
def test_a_run_across_is_the_same_however_it_is_cut():
    """All that decides lies in the arrays of Work: step by step, in one go, and copied into a fresh
    integration just before the first crossing (t = 0.7085 s), bit for bit."""
    model = dap.compile(redundant.four_bars(1))
    evaluator = model.evaluator
    u = model.start(True, ()).u
    y0 = evaluator.integrated(u)

    def integration():
        store_reference_pivots(evaluator, 0.0, u)
        return RungeKutta(
            TABLEAUS["dop853"], evaluator.functions, evaluator.system, evaluator.loops, y0,
            [0.0, 1.0],
            project_on=True, error_size=len(y0) - 1, report_size=evaluator.report_size,
            length_count=evaluator.length_count,
        )  # fmt: skip

    whole, cut, fresh = integration(), integration(), integration()
    assert whole.advance(10**9) is Status.FINISHED
    while cut.t < 0.66:
        cut.advance(0)
    for mine, copy in zip(fresh.work, cut.work, strict=True):
        mine[...] = copy
    for one in (cut, fresh):
        while one.status is Status.RUNNING:
            one.advance(0)
        assert np.array_equal(one.y, whole.y)
        assert one.statistics == whole.statistics
    assert whole.y[1] < 0.0  # the first crank hangs: it has crossed
