"""How accurate the explicit methods are on problems with known answers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.integrands import (
    ADAPTIVE,
    TIGHT,
    finish,
    kepler,
    kepler_f,
    kepler_orbit,
    oscillator,
    slope,
    start,
    time_dependent,
)

from dap3d_core.integrators import TABLEAUS


@pytest.mark.parametrize(
    ("name", "e", "T", "steps"),  # of the asymptotic range, with errors far above rounding
    [
        ("rk4", 0.3, 3.0, (160, 226, 320)),
        ("dopri5", 0.3, 3.0, (57, 80, 113, 160)),
        ("dop853", 0.0, 6.0, (24, 34, 48)),
    ],
)
def test_order_of_fixed_steps(name, e, T, steps):
    """On a Kepler orbit of eccentricity e the error falls as step^order."""
    errors = []
    for n in steps:
        run = start(name, kepler, kepler_orbit(0.0, e), [0.0, T], step=T / n)
        assert finish(run)[-1, 0] == T
        assert run.statistics.steps == n
        errors.append(np.linalg.norm(run.y - kepler_orbit(T, e)))
    assert slope(T / np.array(steps), errors) == pytest.approx(TABLEAUS[name].order, abs=0.2)


@pytest.mark.parametrize(("name", "order", "h"), [("dopri5", 4, 0.05), ("dop853", 7, 0.15)])
def test_order_of_dense_output(name, order, h):
    """Within one step dense output errs by step^(dense order + 1)."""
    sizes, errors = h * np.array([1.0, 1.2, 1.44]), []
    for size in sizes:
        times = size * np.array([0.0, 0.15, 0.4, 0.6, 0.85, 1.0])
        rows = finish(start(name, kepler, kepler_orbit(0.0), times, step=size))
        errors.append(np.linalg.norm(rows[1:-1, 1:] - kepler_orbit(times[1:-1])))
    assert slope(sizes, errors) == pytest.approx(order + 1, abs=0.2)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_tight_run_agrees_with_scipy_and_with_the_exact_solution(name):
    """At tight tolerances every reported state, most of them interpolated, is that of scipy."""
    times = np.linspace(0.0, 6.0, 61)
    rows = finish(start(name, kepler, kepler_orbit(0.0), times, **TIGHT))
    assert np.array_equal(rows[:, 0], times)
    tight = {"rtol": 1e-12, "atol": 1e-12}
    other = solve_ivp(kepler_f, (0.0, 6.0), kepler_orbit(0.0), "DOP853", times, **tight)
    assert np.abs(rows[:, 1:5] - other.y.T).max() < 2e-9
    assert np.abs(rows[:, 1:5] - kepler_orbit(times)).max() < 2e-9


@pytest.mark.parametrize("name", ADAPTIVE)
def test_time_dependent_right_hand_side(name):
    """Stages are evaluated at their own times: two roads to exp(sin t) agree with it."""
    rows = finish(start(name, time_dependent, [1.0, 1.0], np.linspace(0.0, 10.0, 37), **TIGHT))
    assert np.abs(rows[:, 1:3] - np.exp(np.sin(rows[:, :1]))).max() < 1e-9


@pytest.mark.parametrize(("name", "other"), [("dopri5", "RK45"), ("dop853", "DOP853")])
def test_error_is_proportional_to_the_tolerance(name, other):
    """Error and tolerance fall together; error and work are like those of scipy."""
    tolerances, times = 10.0 ** -np.arange(5.0, 12.0), np.linspace(0.0, 20.0, 101)
    exact, errors = kepler_orbit(times), []
    for tol in tolerances:
        run = start(name, kepler, kepler_orbit(0.0), times, rtol=tol, atol=tol)
        errors.append(np.abs(finish(run)[:, 1:5] - exact).max())
        if tol in tolerances[::3]:
            scipy = solve_ivp(kepler_f, (0, 20), exact[0], other, times, rtol=tol, atol=tol)
            assert errors[-1] < 2.0 * np.abs(scipy.y.T - exact).max()
            assert run.statistics.rhs < 1.25 * scipy.nfev  # largest error for the mean: 4^(1/10)
    assert 0.8 < slope(tolerances, errors) < 1.2


def test_trailing_components_do_not_steer_the_step():
    """A quadrature beyond error_size is integrated and changes neither steps nor solution."""
    options = {"rtol": 1e-9, "atol": 1e-9, "error_size": 2}
    alone = start("dop853", oscillator, [0.0, 1.0], [0.0, 5.0], **options)
    longer = start("dop853", oscillator, [0.0, 1.0, 0.0], [0.0, 5.0], **options)
    finish(alone), finish(longer)
    assert alone.statistics == longer.statistics
    assert np.array_equal(alone.y, longer.y[:2])
    assert longer.y[2] == pytest.approx(1e6 * (1 - np.cos(5.0)), rel=1e-8)
