"""Numbers of runs as functions of parameters, with gradients.

Objectives as functions of JAX and PyTorch: values and gradients are those of the runs.
"""

import sys

import numpy as np
import pytest
from scipy.optimize import minimize
from support.plain import jit_is_on

import dap3d_core as dap

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
SETTINGS = {"t_end": 1.0, "dt": 0.01, "rtol": 1e-11, "atol": 1e-13}


def oscillator():
    scene = dap.Scene(name="oscillator")
    scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.5, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", k=40.0, l0=1.0, c=0.8)
    return scene


@pytest.mark.every(5)
@pytest.mark.parametrize("number", ["final", "mean", "rms", "max", "min", "integral"])
def test_gradients_are_those_of_differences(number):
    f = dap.objective(
        oscillator(), ["forces.spring.k", "forces.spring.c"], f"mass.r.x**2:{number}", **SETTINGS
    )
    assert repr(f).startswith("<Objective by forces.spring.k, forces.spring.c of <Scene")
    value, gradient = f.value_and_gradient(f.x0)
    assert value == f(f.x0)
    h = 1e-3
    for k, step in enumerate(np.eye(2) * h):
        difference = (f(f.x0 + step) - f(f.x0 - step)) / (2.0 * h)
        # the difference errs by h^2, and by 1e-11 of the runs over h
        assert gradient[k] == pytest.approx(difference, rel=1e-5, abs=1e-7)
    assert (f.runs, f.gradients) == (5, 1)


def test_a_setting_that_is_given_and_varies():
    f = dap.objective(oscillator(), "simulation.t_end", "mass.r.x:integral", t_end=1.0, dt=0.02)
    assert f.x0 == 1.0
    end = dap.simulate(oscillator(), t_end=0.63).quantity("mass.r.x").values[-1]
    assert f.gradient([0.63])[0] == pytest.approx(end, rel=2e-3)  # of the trapezoidal rule
    assert f([0.63]) < f([1.0])


def test_an_optimum_that_is_known():
    """The throw that goes 2 m in 1 s: speed 2 m/s."""
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 0.0))
    f = dap.objective(scene, "bodies.stone.r_dot.x", "(stone.r.x - 2)**2", t_end=1.0)
    found = minimize(f.value_and_gradient, f.x0, jac=True)
    np.testing.assert_allclose(found.x, 2.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("by", "of", "said"),
    [
        ("forces.spring.kk", "mass.r.x", "did you mean 'forces.spring.k'"),
        ("forces.spring.k", "mas.r.x", "did you mean 'mass.r.x'"),
        ("forces.spring.k", "mass.r", "did you mean 'mass.r.x'"),
        ("forces.spring.k", "mass.r.x:maxi", "did you mean 'mass.r.x:max'"),
        ("forces.spring.k", "mass.r.x + mas.r.x", "mas"),
        ("forces.spring.k", "2 * mass.r : max", "this is a vector"),
        ([], "mass.r.x", "name a parameter"),
    ],
)
def test_what_is_refused(by, of, said):
    with pytest.raises(dap.SceneError, match=said):
        dap.objective(oscillator(), by, of)


def test_points_of_another_size_and_settings_that_are_none():
    f = dap.objective(oscillator(), "forces.spring.k", "mass.r.x")
    with pytest.raises(ValueError, match="2 numbers for 1 parameters"):
        f([1.0, 2.0])
    with pytest.raises(TypeError, match="takes no tend; did you mean 't_end'"):
        dap.objective(oscillator(), "forces.spring.k", "mass.r.x", tend=1.0)


def test_an_output_of_the_name_of_the_objective():
    scene = oscillator()
    scene.outputs["objective"] = "mass.r.x + 1"
    f = dap.objective(scene, "forces.spring.k", "2 * objective", **SETTINGS)
    g = dap.objective(scene, "forces.spring.k", "mass.r.x", **SETTINGS)
    assert f(f.x0) == pytest.approx(2.0 * g(g.x0) + 2.0, rel=1e-14)


@pytest.fixture(scope="module")
def height():
    """The height of a stone after 1 s, 2 v - g / 2 where it is thrown at 2 v m/s."""
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(0.0, 0.0, 3.0))
    scene.add_force("weight", "gravity")
    by = ["bodies.stone.r_dot.z", "forces.gravity.gravity"]
    return dap.objective(scene, by, "2 * stone.r.z", t_end=1.0, dt=0.5)


#: Derivatives of 2 (v t - g t^2 / 2) by v and g, at t = 1 s. Exact to rounding.
EXPECTED = [2.0, -1.0]


def test_jax_differentiates_and_traces_a_run(height):
    """``grad``, ``jit`` and ``vmap``, through arithmetic of JAX around the run."""
    jax = pytest.importorskip("jax")
    with jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64():
        run = height.to_jax()
        assert float(run(height.x0)) == height(height.x0)
        value, gradient = jax.jit(jax.value_and_grad(lambda x: run(x) ** 2 + x[0]))(height.x0)
        y = height(height.x0)
        assert float(value) == pytest.approx(y**2 + 3.0, rel=1e-14)
        expected = 2.0 * y * np.array(EXPECTED) + [1.0, 0.0]
        np.testing.assert_allclose(gradient, expected, rtol=1e-12)
        many = np.stack([height.x0, height.x0 + 1.0])
        np.testing.assert_array_equal(jax.vmap(run)(many), [height(x) for x in many])


def test_pytorch_differentiates_a_run(height):
    """Through arithmetic of PyTorch around the run; without derivatives where none are wanted."""
    torch = pytest.importorskip("torch")
    run = height.to_torch()
    x = torch.tensor(height.x0, requires_grad=True)
    (run(x) ** 2).backward()
    np.testing.assert_allclose(x.grad, 2.0 * height(height.x0) * np.array(EXPECTED), rtol=1e-12)
    before = height.gradients
    assert run(x.detach()).item() == height(height.x0)
    assert height.gradients == before


@pytest.mark.parametrize(("method", "package"), [("to_jax", "jax"), ("to_torch", "torch")])
def test_a_missing_package_is_named(height, monkeypatch, method, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=f"pip install {package}"):
        getattr(height, method)()
