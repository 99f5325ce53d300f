"""Adams methods of variable order: formulas, accuracy, what they do in trouble, runs of scenes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import integrands as toys
from support import problems
from support.integrands import finish, kepler, kepler_f, kepler_orbit, slope
from support.internals import adams, compiled, loop_list
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.integrators import Status
from dap3d_core.integrators.adams import AdamsIntegration


@long_in_plain_python
def test_a_chain_moves_as_with_another_method():
    """Two methods without a common formula agree; constraints and energy hold at every report."""
    scene = problems.chain(3)
    options = {"t_end": 1.0, "dt": 0.05, "rtol": 1e-10, "atol": 1e-10}
    ours = dap.simulate(scene, integrator="adams", **options)
    other = dap.simulate(scene, integrator="dop853", **options)
    assert np.abs(ours.r - other.r).max() < 2e-9
    assert np.abs(ours.w - other.w).max() < 2e-8
    assert ours.ledger["energy"].ok
    assert ours.ledger["position"].value < 1e-12
    assert ours.stats.projections > ours.stats.steps  # accepted and reported states


@long_in_plain_python
def test_steady_precession_of_a_top():
    """G4: the closed form of the motion; fewer right-hand sides than dop853."""
    scene = problems.heavy_top(0.5, 200.0, _precession(0.5, 200.0))
    options = {"t_end": 2.0, "dt": 0.5, "rtol": 1e-11, "atol": 1e-11}
    ours = dap.simulate(scene, integrator="adams", **options)
    other = dap.simulate(scene, integrator="dop853", **options)
    height = 0.1 * np.cos(0.5)
    assert np.abs(ours.r[:, 0, 2] - height).max() < 1e-9
    angle = _precession(0.5, 200.0) * ours.t
    wanted = 0.1 * np.sin(0.5) * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    assert np.abs(ours.r[:, 0, :2] - wanted).max() < 1e-8
    assert ours.stats.rhs < 0.7 * other.stats.rhs


def _precession(theta, spin, A=0.02, C=0.005, moment=0.1 * 9.81):
    """The slow root of A cos(theta) x^2 - C spin x + m g l = 0."""
    a, b = A * np.cos(theta), C * spin
    return (b - np.sqrt(b * b - 4 * a * moment)) / (2 * a)


@pytest.mark.slow
def test_errors_follow_the_tolerances():
    """Andrews' mechanism with 100 reports, beside dop853 at 1e-12: no setting errs out of its turn.
    Errors of its 500 to 1100 steps are not multiplied: their sum is below 20 rtol of its size
    (2.5 at the most). A single bad step would show in the balance of energy, too."""
    model = dap.compile(dap.load("A03"))
    run = {"t_end": 0.05, "dt": 0.0005}
    other = dap.simulate(model, rtol=1e-12, atol=1e-14, **run)
    size, errors = np.abs(other.r).max(), {}
    ladder = [(10.0**-k, 10.0 ** -(k + 2)) for k in range(6, 11)]
    for rtol, atol in [*ladder, (1e-8, 1e-7)]:
        ours = dap.simulate(model, integrator="adams", rtol=rtol, atol=atol, **run)
        errors[rtol, atol] = np.abs(ours.r - other.r).max() / size
        assert errors[rtol, atol] < 20.0 * rtol, (rtol, atol)
        assert ours.ledger["energy"].ok
    assert errors[ladder[-1]] < errors[ladder[0]] / 100.0


def test_turns_are_counted():
    """What is watched at accepted steps is watched here, too: a torsion spring over two turns."""
    scene = dap.Scene(name="torsion")
    scene.add_body("wheel", mass=1.0, Jp=(0.1, 0.1, 0.1), w=(0.0, 0.0, 15.0))
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    axes = {"v_i": "wheel.x", "v_j": "ground.x", "axis": "ground.z"}
    scene.add_force("rot_sda", "spring", k=0.4, turns=True, **axes)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, integrator="adams", rtol=1e-10, atol=1e-10)
    assert 2 * np.pi < 15.0 / 2.0  # amplitude of the swing: more than a turn
    assert np.abs(result.w[:, 0, 2] - 15.0 * np.cos(2.0 * result.t)).max() < 1e-7


def test_what_does_not_fit_is_refused():
    scene = problems.pendulum()
    with pytest.raises(dap.SimulationError, match="adams does not fit method penalty"):
        dap.simulate(scene, t_end=0.1, method="penalty", integrator="adams")
    with pytest.raises(dap.SceneError, match="chooses its step itself"):
        dap.simulate(scene, t_end=0.1, integrator="adams", step=0.01)


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
    assert run.work.next_order > 8
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
