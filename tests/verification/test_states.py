"""States of elements against exact solutions, by every formulation and integrator."""

import numpy as np
import pytest
from support.state_types import REGISTRY, pulled, pulled_exactly

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def on_a_rail():
    """The body of ``pulled`` with rows that hold it to x."""
    scene = pulled()
    scene.add_joint("tran", "rail", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    return scene


@pytest.mark.parametrize(
    ("scene", "method"),
    [(pulled, "auto"), *((on_a_rail, m) for m in ("standard", "lsq", "penalty", "joint"))],
)
def test_a_maxwell_element_by_every_formulation(scene, method):
    """x, v and z are those of the matrix exponential, by some tolerances."""
    compiled = dap.compile(scene(), registry=REGISTRY, method=method)
    result = dap.simulate(compiled, t_end=2.0, dt=0.1, **TIGHT)
    x, v, z = pulled_exactly(result.t)
    assert result.quantity("spring.z").values == pytest.approx(z, abs=1e-10)
    assert result.quantity("cart.r.x").values == pytest.approx(x, abs=1e-10)
    assert result.quantity("cart.rd.x").values == pytest.approx(v, abs=1e-9)
    force = 50.0 * (x - 1.0 - z)
    assert result.force("spring").tension == pytest.approx(force, abs=1e-8)


def test_a_state_in_a_velocity_row():
    """A driver whose velocity is a state: x = z_inf t + (z0 - z_inf) tau (1 - exp(-t / tau))."""
    scene = dap.Scene(name="steered")
    scene.add_body("cart", mass=2.0, Jp=(1.0, 1.0, 1.0), r_dot=(0.5, 0.0, 0.0))
    scene.add_joint("test-steered", "wheel", body_i="cart", target=2.0, tau=0.25, z_0=0.5)
    compiled = dap.compile(scene, registry=REGISTRY)
    result = dap.simulate(compiled, t_end=1.0, dt=0.25, **TIGHT)
    fall = np.exp(-result.t / 0.25)
    assert result.quantity("wheel.z").values == pytest.approx(2.0 - 1.5 * fall, abs=1e-10)
    x = 2.0 * result.t - 1.5 * 0.25 * (1.0 - fall)
    assert result.quantity("cart.r.x").values == pytest.approx(x, abs=1e-10)
    power = result.quantity("wheel.force.x").values
    assert power == pytest.approx(2.0 * 1.5 / 0.25 * fall, abs=1e-8)
