"""The estimate of a run's error: what it is made of, where it is kept, what it leaves alone."""

import importlib
import pickle

import netCDF4
import numpy as np
import pytest
from support import problems

import dap3d_core as dap
from dap3d_core.result import ErrorEstimate, Note, estimated_error

#: The module; the package has a function of its name.
LOOP = importlib.import_module("dap3d_core.simulation.run")
SHORT = dict(t_end=0.2, dt=0.05, rtol=1e-5, atol=1e-7)


@pytest.fixture(scope="module")
def estimated():
    return dap.simulate(problems.pendulum(), estimate_error=True, **SHORT)


def test_it_is_the_difference_to_a_run_ten_times_tighter():
    """Up to the second run's own error, a tenth of the first's, which its first step changes.
    Over some dozens of steps; in a handful, as of the other tests here, the first one decides."""
    options = SHORT | dict(t_end=5.0, dt=0.5)
    estimated = dap.simulate(problems.pendulum(), estimate_error=True, **options)
    finer = dap.simulate(problems.pendulum(), **(options | dict(rtol=1e-6, atol=1e-8)))
    apart = np.abs(estimated.r - finer.r).max()
    assert apart > 1e-10
    assert estimated.error.r.max() == pytest.approx(apart, rel=0.2)


def test_fixed_steps_are_halved():
    fixed = dict(t_end=0.2, dt=0.05, integrator="rk4", step=0.025)
    result = dap.simulate(problems.pendulum(), estimate_error=True, **fixed)
    finer = dap.simulate(problems.pendulum(), **(fixed | dict(step=0.0125)))
    apart = np.abs(result.r - finer.r)
    largest = [apart[0], *(apart[k - 1 : k + 2].max(axis=0) for k in range(1, len(apart)))]
    np.testing.assert_allclose(result.error.r, largest, rtol=0, atol=1e-14)
    assert result.error.r.max() > 1e-10


def test_it_changes_nothing_of_the_run_itself(estimated):
    plain = dap.simulate(problems.pendulum(), **SHORT)
    np.testing.assert_array_equal(estimated.u, plain.u)
    assert plain.error is None
    assert estimated.stats.rhs == plain.stats.rhs
    added = [note for note in estimated.notes if note not in plain.notes]
    assert len(added) == 1
    assert not Note(added[0]).is_warning
    assert "rtol 1e-06" in added[0]


def test_its_accessors_are_those_of_the_result(estimated):
    for name in ("r", "p", "rd", "w"):
        assert getattr(estimated.error, name).shape == getattr(estimated, name).shape
        assert (getattr(estimated.error, name) >= 0.0).all()
    assert estimated.error.u.shape == estimated.u.shape


def test_it_travels_with_the_result(estimated, tmp_path):
    """Through a file, xarray and another process, bit for bit; a file without it opens without."""
    estimated.save(tmp_path / "a.nc")
    opened = dap.open(tmp_path / "a.nc")
    np.testing.assert_array_equal(opened.error.u, estimated.error.u)
    with netCDF4.Dataset(tmp_path / "a.nc") as dataset:
        assert dataset.variables["u_error"].dimensions == ("time", "state")
        assert "no bound" in dataset.variables["u_error"].long_name
    assert opened.to_xarray().u_error.shape == estimated.u.shape
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(opened)).error.u, estimated.error.u)
    dap.simulate(problems.pendulum(), **SHORT, output=tmp_path / "b.nc")
    with netCDF4.Dataset(tmp_path / "b.nc") as dataset:
        assert "u_error" not in dataset.variables
    assert dap.open(tmp_path / "b.nc").error is None


def test_it_is_written_into_the_output(tmp_path):
    result = dap.simulate(
        problems.pendulum(), estimate_error=True, output=tmp_path / "a.nc", **SHORT
    )
    np.testing.assert_array_equal(dap.open(tmp_path / "a.nc").error.u, result.error.u)


def test_one_instant_has_no_error():
    result = dap.simulate(problems.pendulum(), t_end=0.0, estimate_error=True)
    assert (result.error.u == 0.0).all()


def test_euler_parameters_of_either_sign_do_not_differ():
    u = np.zeros((1, 13))
    u[0, 3:7] = [0.6, 0.8, 0.0, 0.0]
    other = u.copy()
    other[0, 3:7] *= -1.0
    assert estimated_error(u, other, 0).max() == 0.0


def test_rounding_is_the_least_that_is_told():
    """eps times the root of the steps times the size: 2^-52 * 10 * 3 for a position of 3 m."""
    u = np.zeros((1, 13))
    u[0, 0], u[0, 3] = 3.0, 1.0
    found = estimated_error(u, u, 100)
    assert found[0, :3] == pytest.approx(30.0 * 2.0**-52, rel=1e-12)
    assert (found[0, 7:] == 0.0).all()  # nothing moves


def test_from_when_on_a_state_means_nothing():
    """A flip about the unstable axis: a loose run misses it, and says from when on."""
    scene = problems.free_body((1.0, 2.0, 3.0), (0.001, 5.0, 0.001))
    loose = dap.simulate(scene, t_end=10.0, dt=0.1, rtol=1e-2, atol=1e-2, estimate_error=True)
    tight = dap.simulate(scene, t_end=10.0, dt=0.1, rtol=1e-10, atol=1e-12, estimate_error=True)
    when = loose.error.meaningless_from
    assert 0.0 < when < 10.0
    k = int(np.searchsorted(loose.t, when))
    w = np.linalg.norm(loose.error.w[:, 0], axis=1)
    p = np.linalg.norm(loose.error.p[:, 0], axis=1)
    size = np.linalg.norm(loose.w, axis=2).max()
    assert w[k] > 1e-3 * size or p[k] > 1e-3
    assert (w[:k] <= 1e-3 * size).all()
    assert tight.error.meaningless_from is None


def growing(law):
    """The estimate of a body whose place of 1 m is off by law(t) metres at 0, 0.1, ... 10 s."""
    t = np.linspace(0.0, 10.0, 101)
    error = np.zeros((101, 13))
    error[1:, 0] = law(t[1:])
    return ErrorEstimate(t, error, {"r": 1.0, "p": 1.0, "rd": 1.0, "w": 1.0})


def test_a_time_of_tenfold_growth():
    """Of 1e-9 * 10^t: one second; errors as large as the motion, from 7 s on, do not count."""
    found = growing(lambda t: np.minimum(1e-9 * 10.0**t, 1.0 + np.sin(5.0 * t)))
    assert found.tenfold == pytest.approx(1.0, rel=1e-9)
    assert found.meaningless_from == pytest.approx(6.1)


@pytest.mark.parametrize(
    "law",
    [
        *(lambda t, power=power: 1e-9 * t**power for power in (1.0, 2.0, 8.0)),
        lambda t: 1e-9 * 10.0 ** (0.2 * t),  # two decades in all: nobody can say how they go on
    ],
)
def test_powers_of_time_and_little_growth_are_no_exponentials(law):
    assert growing(law).tenfold is None


def test_the_tightest_tolerance_has_no_estimate_and_says_so():
    result = dap.simulate(
        problems.pendulum(), t_end=0.01, dt=0.01, rtol=1e-14, atol=1e-14, estimate_error=True
    )
    assert result.error is None
    assert "cannot be made any tighter" in result.notes[-1]


def broken(monkeypatch, error):
    """Lets every second run fail."""
    original, begun = LOOP.Run.execute, []

    def go(self, *arguments, **options):
        begun.append(self)
        if len(begun) > 1:
            raise error
        return original(self, *arguments, **options)

    monkeypatch.setattr(LOOP.Run, "execute", go)


def test_a_second_run_that_fails_leaves_the_first_with_the_reason(monkeypatch, tmp_path):
    broken(monkeypatch, dap.SimulationError("the step size fell"))
    result = dap.simulate(
        problems.pendulum(), estimate_error=True, output=tmp_path / "a.nc", **SHORT
    )
    assert result.status == "done"
    assert result.error is None
    assert "the step size fell" in result.notes[-1]
    assert result.notes[-1].is_warning
    assert dap.open(tmp_path / "a.nc").notes[-1] == result.notes[-1]


def test_an_interrupted_second_run_leaves_the_whole_first(monkeypatch):
    broken(monkeypatch, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt) as caught:
        dap.simulate(problems.pendulum(), estimate_error=True, **SHORT)
    kept = caught.value.result
    assert kept.status == "done"
    assert kept.t[-1] == 0.2
    assert "left out" in kept.notes[-1]
