"""What rounding may excuse, and when a run stalls."""

import numpy as np
import pytest
from support.internals import KIND, NOISE, Y

from dap3d_core.integrators import TABLEAUS, RungeKutta
from dap3d_core.integrators.stepping.output import ATTEMPTS, STALL_WORK, judge_pace
from dap3d_core.integrators.stepping.rounding import judge_noise
from dap3d_core.integrators.stepping.vector_ops import scaled_largest

RTOL = 1e-8


def state_of(y, kinds=(), t_end=1.0):
    run = RungeKutta(TABLEAUS["dop853"], [], (), (), y, [0.0, t_end], rtol=RTOL, kinds=kinds)
    return run.work


@pytest.mark.parametrize(("error", "passes"), [(1e-6, True), (3e-6, False)])
def test_rounding_excuses_no_more_than_a_millionth(error, passes):
    """Components of two kinds, of sizes 2 and 1e-3; rates known to nothing at all. An error up to
    1e-6 of its kind's size passes, also of a component that is zero, and no larger one."""
    work = state_of([0.0, 2.0, 1e-3, 0.0, 5.0], kinds=[0, 0, 2, 2])
    assert work.tolerance[KIND].tolist() == [0, 0, 2, 2, 4]
    work.tolerance[NOISE] = 1e6
    judge_noise(work, 1.0)
    assert work.rounding_state == 2
    y = work.state[Y]
    for i, size in enumerate((2.0, 2.0, 1e-3, 1e-3)):
        x = np.zeros(5)
        x[i] = error * size
        largest = scaled_largest(np.zeros(5), x, y, y, 4, RTOL, work.tolerance, 1.0)
        assert bool(largest <= 1.0) is passes, (i, largest)


def test_noise_far_below_the_tolerances_is_forgotten():
    """Then errors are those of the tolerances alone, to the bit."""
    work = state_of([1.0, 2.0])
    work.tolerance[NOISE] = 1e-13
    judge_noise(work, 1e-3)
    assert work.rounding_state == 0
    assert not work.tolerance[NOISE].any()


def attempts(work, count, step, rhs):
    """Attempts of so long a step and so many right-hand sides; after how many the run stalls."""
    for k in range(count):
        if judge_pace(work):
            return k
        work.t += step
        work.rhs_count += rhs
    return None


@pytest.mark.parametrize(("step", "stalls"), [(0.9e-9, True), (1.1e-9, False)])
def test_steps_below_1e_9_of_the_run_stall_it(step, stalls):
    """For a second of work: right-hand sides times components."""
    work = state_of(np.zeros(10), t_end=2.0)
    needed = STALL_WORK // (10 * 100)
    found = attempts(work, needed + 3 * ATTEMPTS, 2.0 * step, 100)
    assert (found is not None) is stalls
    if stalls:
        assert needed <= found <= needed + 2 * ATTEMPTS


def test_a_longer_step_ends_a_stall():
    work = state_of(np.zeros(10), t_end=2.0)
    needed = STALL_WORK // (10 * 100)
    assert attempts(work, needed - ATTEMPTS, 1e-12, 100) is None
    work.t += 1e-4
    assert attempts(work, needed - ATTEMPTS, 1e-12, 100) is None


def test_fixed_steps_do_not_stall():
    work = state_of(np.zeros(10), t_end=2.0)
    work.fixed_step = 1e-12
    assert attempts(work, 2 * STALL_WORK // 1000, 1e-12, 100) is None
