"""State spaces of scenes whose elements have states, against closed forms."""

import numpy as np
import pytest
from support.state_types import REGISTRY, steered

import dap3d_core as dap

K, C, K_P, MASS = 80.0, 4.0, 30.0, 2.0
#: x, v, z of a mass on a standard linear solid.
A = np.array([[0.0, 1.0, 0.0], [-(K + K_P) / MASS, 0.0, K / MASS], [K / C, 0.0, -K / C]])


def masses(count=1):
    """Masses on rails along x, each on a solid at rest."""
    scene = dap.Scene(name="solids")
    for k in range(count):
        y = float(k)
        scene.add_body(f"m{k}", mass=MASS, Jp=(1.0, 1.0, 1.0), r=(1.0, y, 0.0))
        scene.add_point(f"wall{k}", "ground", (0.0, y, 0.0))
        scene.add_joint("tran", f"rail{k}", P_i=f"m{k}.O", P_j=f"wall{k}", a_j="ground.x")
        scene.add_force("maxwell", f"solid{k}", P_i=f"m{k}.O", P_j=f"wall{k}", k=K * (1.0 + k),
                        c=C, k_p=K_P, l0=1.0)  # fmt: skip
    return scene


def test_eigenvalues_inputs_and_outputs_of_a_solid():
    """Twice the freedoms and one state more; transfer functions of any outputs."""
    names = ["m0.r.x", "m0.rd.x", "solid0.z", "solid0.tension"]
    lin = dap.linearize(masses(), outputs=names)
    assert lin.A.shape == (3, 3)
    assert lin.element_states == ("solid0.z",)
    assert np.sort_complex(lin.eigenvalues) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(A)), rel=1e-12
    )
    states = lin.C[:3]  # of the closed form by those of A
    assert states @ lin.A == pytest.approx(A @ states, abs=1e-6)
    tension = (K + K_P) * states[0] - K * states[2]
    assert lin.C[3] == pytest.approx(tension, abs=1e-6)
    assert lin.is_steady
    moving = masses()
    moving.forces["solid0"].fields["z_0"] = 0.1
    assert not dap.linearize(moving).is_steady


def test_a_number_of_a_rate_is_an_input():
    """l0 acts on the force and on the rate."""
    lin = dap.linearize(masses(), inputs=["solid0.l0"], outputs=["m0.r.x", "solid0.z"])
    dc = -lin.C @ np.linalg.solve(lin.A, lin.B)
    assert dc[:, 0] == pytest.approx((1.0, 0.0), abs=1e-9)  # it moves with its rest length
    assert lin.B[-1, 0] == pytest.approx(-K / C)


def test_a_row_that_depends_on_a_state():
    """The velocity of the cart is the state: eigenvalue -1 / tau, force m z_dot."""
    scene = steered()
    scene.joints["wheel"].fields["z_0"] = 2.0
    scene.bodies["cart"].r_dot = (2.0, 0.0, 0.0)
    compiled = dap.compile(scene, registry=REGISTRY)
    lin = dap.linearize(compiled, outputs=["cart.rd.x", "wheel.force.x"])
    assert np.min(lin.eigenvalues.real) == pytest.approx(-4.0, rel=1e-12)
    assert lin.C[:, -1] == pytest.approx((1.0, -2.0 * 4.0), rel=1e-9)


def test_sparse_modes_have_the_states(monkeypatch):
    """Of many bodies, without independent coordinates."""
    dense = dap.linearize(masses(4)).eigenvalues
    monkeypatch.setattr("dap3d_core.simulation.linearization.linearization.MANY_BODIES", 3)
    sparse = dap.linearize(masses(4), modes=3).eigenvalues
    for value in sparse[:4]:
        assert np.min(np.abs(dense - value)) < 1e-6 * np.abs(value)
