"""Reports: the reference is that of closed forms, errors fall with the order, chaos is told."""

import numpy as np
import pytest
from support import problems

import dap3d_core as dap


@pytest.mark.slow
def test_the_reference_of_the_pendulum_is_that_of_elliptic_functions():
    """A01 (benchmarks.md 1) at t = 1 and 10; two periods a second long amplify 1e-13 by 1e3."""
    found = dap.report(problems.pendulum(), quick=True, t_end=10.0, dt=1.0, methods=["standard"])
    reference = found.reference
    digits = {
        1.0: (0.98629175113187532, -0.16501085312554117),
        10.0: (-0.27508746257611686, -0.96141920509912506),
    }
    for t, xy in digits.items():
        k = int(np.argmin(np.abs(reference.t - t)))
        assert reference.u[k, :2] == pytest.approx(xy, abs=1e-10)
    assert reference.uncertainty < 1e-8


@pytest.mark.slow
def test_errors_of_fixed_steps_fall_with_the_order():
    """G1, rk4: halving the step divides the error by 2^4, to an order of 4 within 0.2."""
    scene = problems.free_body((1.0, 2.0, 3.0), (1.0, 2.0, 0.5))
    found = dap.report(
        scene, integrators=["rk4"], steps=[0.04, 0.02, 0.01], t_end=4.0, dt=0.04, repeat=1
    )
    errors = np.array([run.error for run in found.runs])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(4.0, abs=0.2)
    assert found.reference.uncertainty < 1e-3 * errors[-1]


@pytest.mark.slow
def test_chaos_is_told_and_errors_are_measured_up_to_there():
    """A chain of three rods from the horizontal: two runs at 1e-13 part before 30 s.
    It loses four digits in 5 s (benchmarks.md 3), so that 1e-13 grows to 1e-3 after some 13 s or
    more: neighbours part at that rate only while they are close to each other."""
    found = dap.report(
        problems.chain(3), quick=True, t_end=30.0, dt=0.1, methods=["standard", "lsq"]
    )
    reference = found.reference
    assert 5.0 < reference.meaningless_from < 30.0
    assert reference.t[-1] == pytest.approx(reference.meaningless_from - 0.1, abs=1e-9)
    assert len(reference.t) == len(reference.u)
    assert any("chaos" in note for note in reference.notes)
    assert any("shorter final time" in note for note in found.notes)
