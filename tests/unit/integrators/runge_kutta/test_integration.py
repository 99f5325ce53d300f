"""The integrators: bookkeeping, chunks, projection, and what they do where a run cannot go on."""

import numpy as np
import pytest
from support.integrands import (
    ADAPTIVE,
    ALL,
    TIGHT,
    blow_up,
    circle,
    circle_until_one,
    finish,
    kepler,
    kepler_f,
    kepler_orbit,
    nan_after_one,
    oscillator,
    report_until_one,
    spiral,
    start,
    time_dependent,
)

from dap3d_core.integrators import TABLEAUS, Status

# ------------------------------------------------------------------ bookkeeping


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("inside", [False, True])
def test_statistics_count_calls(name, inside):
    """Counts are the calls that the functions saw, and follow from the stages of the method."""
    times = np.linspace(0.0, 9.0, 13) if inside else [0.0, 9.0]
    step = 0.01 if name == "rk4" else None
    run = start(name, kepler, kepler_orbit(0.0, 0.7), times, step=step, rtol=1e-5, report_size=2)
    rows = finish(run)
    s = run.statistics
    assert [s.rhs, s.projections, s.reports] == run.calls.tolist()
    assert (s.reports, s.projections) == (len(rows), 0)
    assert np.allclose(rows[:, -1], 2 * rows[:, 0] * rows[:, 1], rtol=1e-15)
    if name == "rk4":
        assert (s.rhs, s.steps, s.rejected) == (4 * 900, 900, 0)
        return
    assert s.rejected > 0  # else the test is too tame
    if name == "dopri5":
        assert s.rhs == 2 + 6 * (s.steps + s.rejected)
    elif not inside:
        assert s.rhs == 1 + 11 * (s.steps + s.rejected) + s.steps
    else:
        further = s.rhs - (1 + 11 * (s.steps + s.rejected) + s.steps)
        assert 3 <= further <= 3 * 11 + 1  # three in a step with reports inside, one at t_end


def test_fixed_steps_hit_every_reporting_time():
    """rk4 divides each gap into ceil(gap / step) equal steps; a last digit adds no step."""
    times = [0.0, 0.07, 0.072, 1.0]  # 0.07 / 0.01 is 7.000000000000001
    run = start("rk4", time_dependent, [1.0, 1.0], times, step=0.01)
    rows = finish(run)
    assert rows[:, 0].tolist() == times
    assert run.statistics.steps == 7 + 1 + 93
    assert np.abs(rows[:, 1] - np.exp(np.sin(rows[:, 0]))).max() < 1e-5


def hairer_times(method, f, y, t_end, tol):
    """Ends of accepted steps and number of rejections, after the book and its codes."""
    a, c, s, p = method.a, method.c, method.stages, method.order
    beta = 0.04 if p == 5 else 0.0
    smallest, largest, exponent = (0.2, 10, 0.17) if p == 5 else (0.333, 6, 0.125)
    t, times, rejected, f0, old, again = 0.0, [0.0], 0, f(0.0, y), 1e-4, False
    scale = tol + tol * np.abs(y)
    h = 0.01 * np.max(np.abs(y / scale)) / np.max(np.abs(f0 / scale))
    second = np.max(np.abs((f(h, y + h * f0) - f0) / scale)) / h
    second = max(second, np.max(np.abs(f0 / scale)))
    h = min(100 * h, (0.01 / second) ** (1 / p))
    while t < t_end:
        if t + 1.01 * h >= t_end:
            h = t_end - t
        k = []
        for i in range(s + 1):
            y1 = y + h * sum((w * kj for w, kj in zip(a[i], k, strict=False)), np.zeros(y.size))
            k.append(f(t + c[i] * h, y1))
        scale = tol + tol * np.maximum(np.abs(y), np.abs(y1))
        estimates = [np.max((e[: s + 1] @ np.array(k) / scale) ** 2) for e in method.e]
        error = h * np.sqrt(estimates[0])
        if p == 8:
            error *= np.sqrt(estimates[0] / (estimates[0] + 0.01 * estimates[1]))
        if error > 1:
            h /= min(1 / smallest, error**exponent / method.safety)
            rejected, again = rejected + 1, True
            continue
        t, y = t + h, y1
        times.append(t)
        new = h / max(1 / largest, min(1 / smallest, error**exponent / old**beta / method.safety))
        h, old, again = min(h, new) if again else new, max(error, 1e-4), False
    return times, rejected


@pytest.mark.parametrize("name", ADAPTIVE)
def test_steps_are_those_of_the_literature(name):
    """Accepted and rejected steps are those of Hairer's control, written down a second time."""
    y0, t_end = kepler_orbit(0.0, 0.7), 12.1
    run = start(name, kepler, y0, [0.0, t_end], rtol=1e-6, atol=1e-6)
    times = [0.0]
    while run.advance(0) is Status.RUNNING:
        if run.t > times[-1]:
            times.append(run.t)
    times.append(run.t)
    wanted, rejected = hairer_times(TABLEAUS[name], kepler_f, y0, t_end, 1e-6)
    assert (run.statistics.steps, run.statistics.rejected) == (len(wanted) - 1, rejected)
    assert times == pytest.approx(wanted, abs=1e-6)
    # the last step is stretched by half a percent rather than followed by a tiny one
    t_end = times[5] + 0.005 * (times[5] - times[4])
    run = start(name, kepler, y0, [0.0, t_end], rtol=1e-6, atol=1e-6)
    finish(run)
    assert (run.statistics.steps, run.t) == (5, t_end)


def test_first_step_is_tried_as_given():
    """A first step that is too long is rejected; f at the start is not evaluated again."""
    run = start("dopri5", kepler, kepler_orbit(0.0), [0.0, 6.0], first_step=3.0)
    finish(run)
    s = run.statistics
    assert s.rejected > 1
    assert s.rhs == 1 + 6 * (s.steps + s.rejected)


def chunked(name, budget, buffer_rows=64, interrupt=False):
    step = 0.05 if name == "rk4" else None
    times = np.concatenate([np.linspace(0.0, 0.2, 20), [1.0, 4.0]])
    options = {"step": step, "project_on": True, "report_size": 1, "buffer_rows": buffer_rows}
    run = start(name, spiral, [1.0, 0.0], times, circle, rtol=1e-6, **options)
    if interrupt:
        run.advance(40)
        other = start(name, spiral, [1.0, 0.0], times, circle, rtol=1e-6, **options)
        for mine, theirs in zip(other.work, run.work, strict=True):
            if mine.flags.writeable:
                mine[:] = theirs
        run = other
    return finish(run, budget), run.y, run.statistics


@pytest.mark.parametrize("name", ALL)
def test_result_does_not_depend_on_chunks(name):
    """Rows, state and counts are equal bit for bit, whatever the budget, the buffer, the object."""
    rows, y, statistics = chunked(name, 10**9)
    assert len(rows) == 22
    for other in (
        chunked(name, 0),
        chunked(name, 17, buffer_rows=3),
        chunked(name, 10**9, buffer_rows=1),
        chunked(name, 5, interrupt=True),
    ):
        assert np.array_equal(other[0], rows)
        assert np.array_equal(other[1], y)
        assert other[2] == statistics


def test_buffer_holds_the_run_until_it_is_drained():
    """A full buffer ends a call; advancing without taking the rows is an error."""
    run = start("dop853", oscillator, [0.0, 1.0], np.linspace(0.0, 1.0, 11), buffer_rows=4)
    assert run.advance(10**9) is Status.RUNNING
    with pytest.raises(RuntimeError, match=r"rows\(\)"):
        run.advance(10**9)
    taken = [run.rows()]
    while run.advance(10**9) is Status.RUNNING:
        taken.append(run.rows())
    taken.append(run.rows())
    assert [len(part) for part in taken] == [4, 4, 3]
    assert len(run.rows()) == 0
    assert np.array_equal(np.concatenate(taken)[:, 0], np.linspace(0.0, 1.0, 11))


def test_no_time_to_pass_is_one_report():
    """With t_end = t0 the initial state is reported and nothing evaluated."""
    run = start("dop853", oscillator, [0.5, 1.0], [2.0], report_size=1)
    assert finish(run).tolist() == [[2.0, 0.5, 1.0, 1.0]]
    assert (run.status, run.statistics) == (Status.FINISHED, (0, 0, 0, 0, 1))
    assert run.t_stop is None


# ------------------------------------------------------------------ projection


@pytest.mark.parametrize("name", ALL)
def test_projection_holds_at_every_row_and_leaves_the_rest(name):
    """On the circle the spiral is (cos t, sin t) at every reported time, interpolated or not."""
    times = np.linspace(0.0, 7.0, 50)
    step = 0.01 if name == "rk4" else None
    run = start(name, spiral, [1.0, 0.0], times, circle, project_on=True, step=step, **TIGHT)
    rows = finish(run)
    assert np.abs(np.hypot(rows[:, 1], rows[:, 2]) - 1).max() < 1e-15
    assert np.abs(rows[:, 1] + 1j * rows[:, 2] - np.exp(1j * times)).max() < 1e-8
    s = run.statistics
    interpolated = 0 if name == "rk4" else 48
    assert [s.rhs, s.projections, s.reports] == run.calls.tolist()
    assert s.projections == s.steps + interpolated
    free = finish(start(name, spiral, [1.0, 0.0], times, circle, step=step))
    assert np.hypot(*free[-1, 1:3]) == pytest.approx(np.exp(0.7), rel=1e-6)


@pytest.mark.parametrize("name", ALL)
def test_failed_projection_stops_the_run(name):
    """Where projection fails the run ends in front of it, with that reason."""
    step = 0.25 if name == "rk4" else None
    run = start(name, spiral, [1.0, 0.0], [0.0, 3.0], circle_until_one, project_on=True, step=step)
    finish(run)
    assert run.status is Status.PROJECTION_FAILED
    assert run.t == pytest.approx(1.0, abs=1e-12)
    assert run.t <= 1.0 < run.t_stop


# ------------------------------------------------------------------ what goes wrong


@pytest.mark.parametrize("name", ALL)
def test_nan_stops_the_run_with_finite_rows(name):
    """The run comes as near to t = 1 as steps can, and nothing that is not finite is kept."""
    times = np.linspace(0.0, 2.0, 21)
    run = start(name, nan_after_one, [0.0], times, step=0.03 if name == "rk4" else None)
    rows = finish(run)
    assert run.status is Status.NOT_FINITE
    assert run.t == pytest.approx(1.0, abs=1e-12)
    assert len(rows) in (10, 11)
    assert np.all(np.isfinite(rows))
    assert np.all(np.isfinite(run.y))
    assert rows[:, 1] == pytest.approx(np.sin(rows[:, 0]), abs=1e-6)
    before = run.statistics
    assert run.advance(100) is Status.NOT_FINITE
    assert run.statistics == before


@pytest.mark.parametrize("name", ALL)
def test_nan_in_the_last_step_is_not_accepted(name):
    """A last step over t = 1 leaves time and state as they were, though f at its end is unused."""
    run = start(name, nan_after_one, [0.0], [0.0, 1.05], step=0.21)
    rows = finish(run)
    assert (run.status, len(rows)) == (Status.NOT_FINITE, 1)
    assert (run.t, run.t_stop) == (pytest.approx(0.84), 1.05)
    assert run.y == pytest.approx(np.sin(0.84), abs=1e-4)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_nan_in_a_component_that_does_not_steer_stops_the_run(name):
    """A quadrature beyond error_size is watched as well."""
    run = start(name, nan_after_one, [0.0], [0.0, 0.9, 2.0], error_size=0)
    rows = finish(run)
    assert (run.status, len(rows)) == (Status.NOT_FINITE, 2)
    assert run.t == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.isfinite(run.y))


@pytest.mark.parametrize("name", ALL)
def test_nan_at_the_start_stops_at_once(name):
    """Where dy/dt is not a number at t0 one evaluation suffices."""
    run = start(name, nan_after_one, [0.0], [1.5, 2.0], step=0.1 if name == "rk4" else None)
    finish(run)
    assert (run.status, run.t, run.t_stop) == (Status.NOT_FINITE, 1.5, 1.5)
    assert (run.statistics.rhs, run.statistics.steps) == (1, 0)


def test_report_that_is_not_finite_stops_the_run():
    """A reported infinity ends the run at its time, and its row is not stored."""
    times = np.linspace(0.0, 2.0, 9)
    run = start("dop853", oscillator, [0.0, 1.0], times, report=report_until_one, report_size=1)
    rows = finish(run)
    assert (run.status, run.t_stop) == (Status.NOT_FINITE, 1.0)
    assert np.array_equal(rows[:, 0], times[:4])


@pytest.mark.parametrize("name", ADAPTIVE)
def test_singularity_ends_at_the_step_floor(name):
    """1 / (1 - t) cannot be followed beyond t = 1: the step shrinks to its floor there."""
    run = start(name, blow_up, [1.0], [0.0, 0.5, 2.0])
    rows = finish(run)
    assert run.status is Status.STEP_FLOOR
    assert run.t == pytest.approx(1.0, abs=1e-6)
    assert np.all(np.isfinite(run.y))
    assert rows[-1] == pytest.approx([0.5, 2.0], rel=1e-6)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("rk4", {}, "rk4 does not choose its step"),
        ("rk4", {"step": -0.1}, "step is -0.1"),
        ("rk4", {"step": 1e-17}, "rounding of time"),
        ("dop853", {"first_step": np.nan}, "first_step is nan"),
        ("dop853", {"rtol": 0.0, "atol": 0.0}, "not both zero"),
        ("dop853", {"rtol": np.nan}, "rtol is nan"),
    ],
)
def test_what_makes_no_sense_is_refused(name, options, words):
    """Each mistake is a ValueError that says what is wrong."""
    options = {"y0": [0.0, 1.0], "times": [0.0, 1.0]} | options
    with pytest.raises(ValueError, match=words):
        start(name, oscillator, **options)
