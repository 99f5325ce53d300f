"""A second process compiles the integrator ahead: for the types of a run, and never in its way."""

import pytest
from unit.test_integrators_problems import finish, oscillator, start

from dap3d_core.integrators import ahead
from dap3d_core.integrators.runge_kutta import advance
from dap3d_core.kernels import beside
from dap3d_core.kernels.cache import jit_is_on

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(beside, "_cores", lambda: 2)


@pytest.fixture
def started(monkeypatch):
    """What was asked of another process."""
    asked = []
    monkeypatch.setattr(ahead, "compile_beside", asked.append)
    monkeypatch.setattr(ahead, "driver_is_cached", lambda floor: False)
    return asked


def test_what_is_compiled_ahead_is_what_a_run_needs():
    """A run asks for no other types of arguments."""
    ahead.main()
    compiled = set(advance.signatures)
    finish(start("dop853", oscillator, [0.0, 1.0], [0.0, 0.1], rtol=1e-6, atol=1e-6))
    assert set(advance.signatures) == compiled


@pytest.mark.parametrize("integrator", ["auto", "dop853", "dopri5", "rk4", "adams", "radau"])
def test_only_what_the_run_asks_for_is_compiled_ahead(started, integrator):
    """adams and radau have algorithms of their own."""
    ahead.start(integrator)
    assert bool(started) == (integrator not in ("adams", "radau"))


def test_what_is_in_the_cache_is_not_compiled_ahead(started, monkeypatch):
    monkeypatch.setattr(ahead, "driver_is_cached", lambda floor: True)
    ahead.start("dop853")
    assert not started


def test_a_process_that_fails_is_waited_for_and_forgotten(two_cores):
    """It leaves nothing behind; what it should have compiled is compiled by the run."""
    beside.compile_beside("dap3d_core.there_is_no_such_module")
    (process,) = beside._running
    beside.wait_for_what_is_beside()
    assert process.returncode not in (None, 0)
    assert not beside._running
    beside.wait_for_what_is_beside()  # nobody is there


def test_without_a_second_core_there_is_no_second_process(monkeypatch):
    monkeypatch.setattr(beside, "_cores", lambda: 1)
    beside.compile_beside("dap3d_core.integrators.ahead")
    assert not beside._running


def test_one_other_process_is_enough(two_cores):
    for _ in range(2):
        beside.compile_beside("dap3d_core.there_is_no_such_module")
    assert len(beside._running) == 1
    beside.wait_for_what_is_beside()
    assert not beside._running
