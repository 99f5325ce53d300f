"""Equilibria with friction against closed forms: cones of friction, rolling down a bowl."""

import numpy as np
import pytest
from verification.test_contacts import ANGLE, G, slope

import dap3d_core as dap


def test_a_block_rests_on_a_slope_within_its_cone():
    found = dap.equilibrium(slope(0.999))
    normals = found.Lam[::3]
    assert normals.sum() == pytest.approx(G * np.cos(ANGLE), rel=1e-12)
    assert found.stable
    assert found.residual < 1e-12
    run = dap.simulate(slope(0.999), start=found, t_end=1.0, dt=0.5)
    assert np.max(np.abs(run.r - run.r[0])) < 1e-14


def test_a_block_beyond_its_cone_slips_by_name():
    with pytest.raises(dap.SimulationError, match=r"floor#1.*slips"):
        dap.equilibrium(slope(1.001))


def ladder(angle, mu):
    """A ladder on a rough floor, at a smooth wall."""
    J = 1.0
    scene = dap.Scene(name="ladder")
    p = [np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0]
    scene.add_body("ladder", mass=3.0, Jp=[0.01, J, J], p=p,
                   r=[np.cos(angle), 0.0, np.sin(angle)])  # fmt: skip
    scene.add_point("foot", "ladder", [1.0, 0.0, 0.0])
    scene.add_point("top", "ladder", [-1.0, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="foot", mu=mu)
    scene.add_contact("ball_plane", "wall", P_i="top", a_j="ground.x")
    return scene


@pytest.mark.slow
def test_a_ladder_rests_where_its_tangent_exceeds_half_the_inverse_of_friction():
    mu = 0.4
    limit = np.arctan(0.5 / mu)
    found = dap.equilibrium(ladder(limit * 1.001, mu))
    push = 3.0 * G / (2.0 * np.tan(limit * 1.001))
    assert found.Lam[[0, 3]] == pytest.approx([3.0 * G, push], rel=1e-12)
    assert np.linalg.norm(found.Lam[1:3]) == pytest.approx(push, rel=1e-12)
    with pytest.raises(dap.SimulationError, match="floor slips"):
        dap.equilibrium(ladder(limit * 0.999, mu))


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_ball_comes_to_rest_at_the_bottom_of_a_bowl(mu):
    big, small, angle = 1.0, 0.1, 0.3
    scene = dap.Scene(name="bowl")
    r = [(big - small) * np.sin(angle), 0.0, (small - big) * np.cos(angle)]
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=r)
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "ground.O", "radius_i": small, "radius_j": big}
    scene.add_contact("ball_ball", "bowl", **ends, inside=True, mu=mu)
    found = dap.equilibrium(scene)
    assert found.r[0] == pytest.approx([0.0, 0.0, small - big], abs=1e-9)
    assert found.Lam[0] == pytest.approx(2.0 * G, rel=1e-9)
    assert found.stable


@pytest.mark.slow
def test_bodies_do_not_rest_in_each_other():
    scene = dap.Scene(name="pressed")
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3, r=[0.0, 0.0, 0.2])
    scene.add_point("A", "ground", [0.0, 0.0, -1.0])
    scene.add_force("ptp", "spring", P_i="ball.O", P_j="A", k=100.0, l0=1.0)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    with pytest.raises(dap.SimulationError, match="floor overlaps"):
        dap.equilibrium(scene)


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_what_falls_together_carries_nothing(integrator):
    """A ball on a box that moves below it, both falling: no force, whose sign would be rounding.
    With these numbers, of a random scene, it was 1e-15 N, and the contact closed: radau took 11 309
    steps for that sign. Relative motion is uniform, so the gap is known; sizes are of 1, of which
    rtol is 1e-10."""
    rtol = 1e-10
    box = (1.3705723113223023, 0.0, 0.828511641099051)
    ball = (1.173903042504666, 0.0, 0.8919948189669008)
    r_dot = (1.6085527461390163, -1.7901756511421658, 0.8787563702608113)
    c, s = 0.9689124217106448, -0.24740395925452296
    scene = dap.Scene(name="falling together")
    scene.add_force("weight")
    scene.add_body("box", mass=0.20557624828443394, Jp=(0.01, 0.015, 0.02), r=box, r_dot=r_dot,
                   p=(c, 0.0, s, 0.0))  # fmt: skip
    scene.add_body("ball", mass=2.913583467756883, Jp=(0.004,) * 3, r=ball)
    scene.add_contact("ball_box", "c", P_i="ball.O", P_j="box.O", radius=0.1, size=(0.4, 0.3, 0.1),
                      e=0.8)  # fmt: skip
    given = {"integrator": integrator, "rtol": rtol, "atol": rtol / 100}
    result = dap.simulate(scene, t_end=0.1, dt=0.01, **given)
    assert result.stats.steps < 100
    assert np.max(np.abs(result.w[:, 0])) < 10.0 * rtol
    axes = np.array([[c * c - s * s, 0.0, 2 * c * s], [0, 1, 0], [-2 * c * s, 0.0, c * c - s * s]])
    seen = (np.subtract(ball, box) - np.outer(result.t, r_dot)) @ axes
    gap = np.linalg.norm(np.maximum(np.abs(seen) - [0.2, 0.15, 0.05], 0.0), axis=1) - 0.1
    assert np.max(np.abs(result.contact("c").gap - gap)) < 10.0 * rtol
