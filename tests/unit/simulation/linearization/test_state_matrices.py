"""Frequency responses against the closed form of two masses on springs and dampers."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import dap3d_core as dap
from dap3d_core.result import UnknownNameError
from dap3d_core.simulation.linearization.state_matrices import peaks

M, C = np.diag([2.0, 1.0]), np.array([[1.5, -0.5], [-0.5, 0.5]])
K = np.array([[300.0, -100.0], [-100.0, 100.0]])


def masses(c=(1.0, 0.5)):
    """Two masses in a row along x, springs at rest; an input pushes the second one."""
    scene = dap.Scene(name="masses")
    for name, mass, x in (("a", 2.0, 1.0), ("b", 1.0, 2.0)):
        scene.add_body(name, mass=mass, Jp=(1.0, 1.0, 1.0), r=(x, 0.0, 0.0))
        scene.add_joint("tran", f"rail_{name}", P_i=f"{name}.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("ptp", "wall", P_i="a.O", P_j="ground.O", k=200.0, c=c[0], l0=1.0)
    scene.add_force("ptp", "between", P_i="a.O", P_j="b.O", k=100.0, c=c[1], l0=1.0)
    scene.add_input("push")
    scene.add_force("f", "hand", body_i="b", f=(1.0, 0.0, 0.0), input="push")
    return scene


def exact(f):
    """(f, 2) displacements of both masses for a unit force on the second."""
    s = 2j * np.pi * np.atleast_1d(f)
    return np.array([np.linalg.solve(K + x * C + x * x * M, [0.0, 1.0]) for x in s])


def test_response_is_that_of_the_closed_form():
    """Displacements, and the velocity as their derivative; a constant input at 0 Hz."""
    lin = dap.linearize(masses(), inputs=["push"], outputs=["a.r.x", "b.r.x", "b.rd.x"])
    f = np.array([0.0, 0.3, 1.1, 1.95, 5.0, 80.0])
    found = lin.frequency_response(f)
    assert found.shape == (6, 3, 1)
    np.testing.assert_allclose(found[:, :2, 0], exact(f), rtol=1e-10)
    np.testing.assert_allclose(found[:, 2, 0], 2j * np.pi * f * exact(f)[:, 1], rtol=1e-10)


def test_other_inputs_and_outputs_may_be_named():
    """Of a linearisation that was made without any."""
    lin = dap.linearize(masses())
    found = lin.frequency_response(1.0, inputs="hand.f.x", outputs=["b.r.x"])
    np.testing.assert_allclose(found[0, 0, 0], 0.0, atol=1e-12)  # times an input of zero
    found = lin.frequency_response([1.0], inputs=["push"], outputs=["b.r.x"])
    np.testing.assert_allclose(found[:, 0, 0], exact(1.0)[:, 1], rtol=1e-10)
    with pytest.raises(ValueError, match="needs inputs"):
        lin.frequency_response(1.0)
    with pytest.raises(UnknownNameError, match="did you mean 'push'"):
        lin.frequency_response(1.0, inputs=["pus"], outputs=["b.r.x"])


@pytest.mark.parametrize("wrong", [-1.0, np.nan, np.ones((1, 2))])
def test_frequencies_that_are_none_are_refused(wrong):
    """Negative, NaN, or a table."""
    lin = dap.linearize(masses(), inputs=["push"], outputs=["b.r.x"])
    with pytest.raises(ValueError, match="0 Hz and more"):
        lin.frequency_response(wrong)


def test_a_peak_is_that_between_the_samples():
    """Of x / y of a mass on a moving base, closed form; 61 samples are 6 dampings wide."""
    r = np.unique(
        np.concatenate([np.geomspace(0.1, 10.0, 200), 1.0 + 0.3 * np.linspace(-1, 1, 61)])
    )

    def gain(r, d=0.2j):
        return (1.0 + d * r) / (1.0 - r**2 + d * r)

    (peak,) = peaks(r, gain(r))
    found = minimize_scalar(lambda x: -abs(gain(x)), bounds=(0.9, 1.0), options={"xatol": 1e-12})
    assert peak.frequency == pytest.approx(found.x, rel=2e-5)
    assert peak.gain == pytest.approx(-found.fun, rel=1e-6)
    assert peak.phase == pytest.approx(np.angle(gain(found.x)), rel=2e-4)
    undamped = np.where(r == 1.0, np.inf, 1.0 / np.where(r == 1.0, 1.0, 1.0 - r**2))
    assert peaks(r, undamped)[0].frequency == 1.0
