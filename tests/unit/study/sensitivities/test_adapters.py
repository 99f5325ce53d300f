"""Objectives as functions of JAX and PyTorch: values and gradients are those of the runs."""

import sys

import numpy as np
import pytest
from support.plain import jit_is_on

import dap3d_core as dap

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")


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
