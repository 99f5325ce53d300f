"""Adams methods of variable order: their formulas, their accuracy, what they do in trouble."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import integrands as toys
from support.integrands import finish, kepler, kepler_f, kepler_orbit, slope
from support.internals import adams, compiled, loop_list

from dap3d_core.integrators import Status
from dap3d_core.integrators.adams.integration import AdamsIntegration


def start(rhs, y0, times, project=toys.no_constraint, report=toys.plain_report, **options):
    """An integration of a toy; its calls are counted in ``.calls``."""
    functions, calls = toys.first_class(rhs, project, report), np.zeros(3)
    run = AdamsIntegration(functions, toys.counting(calls), loop_list([]), y0, times, **options)
    run.calls = calls
    return run


@compiled
def predicted(work, h, k):
    adams.update_coefficients(work, h, k)
    adams.predict(work, h, k)


@pytest.mark.parametrize("k", range(1, adams.HIGHEST + 1))
def test_order_conditions_on_unequal_steps(k):
    """Rates that are a polynomial of degree k - 1 in time are integrated exactly; of degree k, with
    the corrector.
    The differences are made here from their definition, HNW (III.5.3 and 5.8)."""
    rng = np.random.default_rng(k)
    h, ages = 0.7, np.concatenate([[0.0], np.cumsum(rng.uniform(0.4, 1.3, k + 1))])
    for degree in (k - 1, k):
        rate = np.polynomial.Polynomial(rng.uniform(-1.0, 1.0, degree + 1))
        run = start(kepler, [0.25], [0.0, 1.0])
        work = run.work
        divided = rate(-ages)
        for j in range(k + 1):
            work.differences[j, 0] = divided[0] * np.prod(ages[1 : j + 1])
            if j < k:
                divided = (divided[:-1] - divided[1:]) / (ages[j + 1 :] - ages[: -j - 1])
        work.table[adams.PSI, : k + 2] = ages[: k + 2]
        predicted(work, h, k)
        y = work.state[1, 0]  # TRIAL
        if degree == k:
            y += h * work.table[adams.G_ROW, k] * (rate(h) - work.state[2, 0])
        exact = 0.25 + rate.integ()(h)
        # the omitted term of an order less would be 1e5 times as large
        assert y == pytest.approx(exact, abs=1e-12 * np.abs(rate(-ages)).max())


def test_constants_are_those_of_the_literature():
    """|gamma*_j| of HNW, table III.1.2."""
    known = [1, 1 / 2, 1 / 12, 1 / 24, 19 / 720, 3 / 160, 863 / 60480]
    assert adams.make_table()[adams.CONSTANT, :7] == pytest.approx(known, rel=1e-14)


def test_error_is_proportional_to_the_tolerance():
    """Error and tolerance fall together; SciPy's DOP853 takes more right-hand sides."""
    tolerances, errors = 10.0 ** -np.arange(5.0, 12.0), []
    for tol in tolerances:
        run = start(kepler, kepler_orbit(0.0), [0.0, 30.0], rtol=tol, atol=tol)
        finish(run)
        errors.append(np.abs(run.y - kepler_orbit(30.0)).max())
    assert 0.8 < slope(tolerances, errors) < 1.2
    other = solve_ivp(kepler_f, (0, 30), kepler_orbit(0.0), "DOP853", rtol=1e-11, atol=1e-11)
    assert run.order > 8
    assert run.statistics.rhs < 0.75 * other.nfev


@pytest.mark.every(4)
@pytest.mark.parametrize("tol", [1e-7, 1e-9, 1e-11, 1e-12])
def test_reported_states_are_as_good_as_steps(tol):
    """Every interpolated state is as near to the orbit as the steps themselves, to 5 %: its
    order is one above that of the step, so what it adds between two of them is small."""
    options, times = {"rtol": tol, "atol": tol}, np.linspace(0.0, 12.0, 301)
    rows = finish(start(kepler, kepler_orbit(0.0), times, **options))
    assert np.array_equal(rows[:, 0], times)
    run, error = start(kepler, kepler_orbit(0.0), [0.0, 12.0], **options), 0.0
    while run.advance(0) is Status.RUNNING:
        error = max(error, np.abs(run.y - kepler_orbit(run.t)).max())
    assert np.abs(rows[:, 1:5] - kepler_orbit(times)).max() < 1.05 * error


def test_orders_stay_right_when_equal_steps_come_to_an_end():
    """A rate that changes its pace: long runs of equal steps, then others, and back."""
    times = np.linspace(0.0, 60.0, 7)
    run = start(toys.time_dependent, [1.0, 1.0], times, rtol=1e-11, atol=1e-11)
    rows = finish(run)
    assert np.abs(rows[:, 1:3] - np.exp(np.sin(rows[:, :1]))).max() < 2e-9
    assert run.statistics.rejected < 0.1 * run.statistics.steps


@pytest.mark.parametrize("tol", [1e-5, 1e-7, 1e-9])
def test_reports_do_not_steer_the_steps(tol):
    """A hundred reports or one: not a bit of the steps changes, not among equal ones either.
    The steps of an oscillator are equal for long, and coefficients stay from step to step then.
    Each errs by the tolerance at most, and nothing multiplies errors."""
    options, times = {"rtol": tol, "atol": tol}, np.linspace(0.0, 20.0, 101)
    alone = start(toys.oscillator, [0.0, 1.0], [0.0, 20.0], **options)
    often = start(toys.oscillator, [0.0, 1.0], times, **options)
    equal = 0
    while alone.advance(0) is Status.RUNNING:
        equal = max(equal, alone.work.equal_steps)
    assert equal > adams.HIGHEST + 1
    rows = finish(often)
    assert often.statistics[:2] == alone.statistics[:2]
    assert np.array_equal(often.y, alone.y)
    assert np.abs(rows[:, 1] - np.sin(times)).max() < often.statistics.steps * tol


def test_trailing_components_do_not_steer_the_step():
    options = {"rtol": 1e-9, "atol": 1e-9, "error_size": 2}
    alone = start(toys.oscillator, [0.0, 1.0], [0.0, 5.0], **options)
    longer = start(toys.oscillator, [0.0, 1.0, 0.0], [0.0, 5.0], **options)
    finish(alone), finish(longer)
    assert alone.statistics == longer.statistics
    assert np.array_equal(alone.y, longer.y[:2])


def test_chunks_change_no_bit():
    """However a run is cut, its rows are the same, and its counts are the calls that were made."""
    times = np.linspace(0.0, 9.0, 13)
    whole = start(kepler, kepler_orbit(0.0), times, rtol=1e-8, atol=1e-8)
    cut = start(kepler, kepler_orbit(0.0), times, rtol=1e-8, atol=1e-8, buffer_rows=2)
    assert np.array_equal(finish(whole), finish(cut, budget=7))
    assert tuple(whole.calls) == tuple(whole.statistics)[2:]
    assert whole.statistics == cut.statistics


@pytest.mark.parametrize("count", [5, 60])
def test_a_step_that_is_taken_back_leaves_no_trace(count):
    """What events do to locate an instant: steps are taken back, made to another end, taken back.
    Then the run goes on as one in which nothing of that was, to the last bit."""
    plain, other = (start(toys.oscillator, [0.0, 1.0], [0.0, 20.0]) for _ in range(2))
    while other.statistics.steps < count:
        other.advance_to(np.inf)
    t, arrays = other.t, other.state_arrays()
    saved = [array.copy() for array in arrays]
    for h in (np.inf, 0.01, 0.001):
        other.advance_to(t + h)
        assert other.t > t
        for array, before in zip(arrays, saved, strict=True):
            array[...] = before
    finish(plain), finish(other)
    assert other.statistics == plain.statistics
    assert np.array_equal(other.y, plain.y)


def leaving(t, y, out, system, loops):
    """Stays on the unit circle, and leaves it the faster the farther off it is."""
    system.force[0] += 1
    grow = 3.0 * (y[0] * y[0] + y[1] * y[1] - 1.0)
    out[0], out[1] = -y[1] + grow * y[0], y[0] + grow * y[1]


def test_projection_holds_at_steps_and_reports():
    times = np.linspace(0.0, 5.0, 41)
    options = {"rtol": 1e-9, "atol": 1e-9, "project_on": True}
    rows = finish(start(leaving, [1.0, 0.0], times, toys.circle, **options))
    assert np.abs(np.hypot(rows[:, 1], rows[:, 2]) - 1.0).max() < 1e-14
    assert np.abs(rows[:, 1] - np.cos(times)).max() < 1e-7


@pytest.mark.parametrize(
    ("rhs", "y0", "times", "status"),
    [
        (toys.nan_after_one, [0.0], [0.0, 0.9, 2.0], Status.NOT_FINITE),
        (toys.blow_up, [1.0], [0.0, 0.5, 2.0], Status.STEP_FLOOR),
    ],
)
def test_a_run_that_cannot_go_on_says_why(rhs, y0, times, status):
    """What was right is kept: the reported rows before the trouble, and where it is."""
    run = start(rhs, y0, times, rtol=1e-8, atol=1e-8)
    rows = finish(run)
    assert run.status is status
    assert run.t_stop == pytest.approx(1.0, abs=2e-3)
    assert rows[-1, 0] == times[1]


def test_a_failed_projection_ends_the_run():
    options = {"rtol": 1e-8, "atol": 1e-8, "project_on": True}
    run = start(toys.oscillator, [0.0, 1.0], [0.0, 3.0], toys.circle_until_one, **options)
    finish(run)
    assert run.status is Status.PROJECTION_FAILED
    assert run.t == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    "options",
    [{"step": 0.1}, {"rtol": -1.0}, {"first_step": 0.0}],
)
def test_settings_that_make_no_sense_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        start(kepler, kepler_orbit(0.0), [0.0, 1.0], **options)
