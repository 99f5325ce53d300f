"""Springs along axes and of balls, and dry friction of hinges and sliders, against closed forms.
Tolerances: rtol 1e-11 over some seconds leaves some 1e-9 of the largest coordinate."""

import numpy as np
import pytest
from verification.test_sticking_friction import hinge

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_hinge_runs_down_by_its_friction(integrator):
    """I w' = -n tanh(w / w_tol): sinh(w / w_tol) falls as exp(-n t / (I w_tol))."""
    inertia, spin, n, w_tol = 0.3, 2.0, 0.4, 0.5
    scene = hinge(spin)
    scene.add_force("rot_friction", "rub", body_i="wheel", body_j="ground", axis="ground.z", n_c=n,
                    w_tol=w_tol)  # fmt: skip
    result = dap.simulate(scene, t_end=3.0, dt=0.1, integrator=integrator, **TIGHT)
    decay = np.exp(-n * result.t / (inertia * w_tol))
    expected = w_tol * np.arcsinh(np.sinh(spin / w_tol) * decay)
    assert expected[-1] < 0.02 * spin
    np.testing.assert_allclose(result.w[:, 0, 2], expected, rtol=0, atol=1e-9)
    lost = 0.5 * inertia * (result.w[:, 0, 2] ** 2 - spin**2)
    np.testing.assert_allclose(result.work, lost, rtol=0, atol=1e-9)


def test_a_hinge_stops_after_the_angle_of_constant_friction():
    """At t = I w / n, after I w^2 / (2 n), and pi^2 / 12 I w_tol^2 / n of creep more."""
    inertia, spin, n, w_tol = 0.3, 2.0, 0.4, 1e-3
    scene = hinge(spin)
    scene.add_force("rot_friction", "rub", body_i="wheel", body_j="ground", axis="wheel.z", n_c=n,
                    w_tol=w_tol)  # fmt: skip
    result = dap.simulate(scene, t_end=3.0, dt=0.25, integrator="radau", **TIGHT)
    expected = np.maximum(spin - n / inertia * result.t, 0.0)  # it stops at 1.5 s
    far = np.abs(result.t - 1.5) > 0.1
    np.testing.assert_allclose(result.w[far, 0, 2], expected[far], rtol=0, atol=1e-9)
    angle = 2.0 * np.arctan2(result.p[-1, 0, 3], result.p[-1, 0, 0])
    creep = np.pi**2 / 12.0 * inertia * w_tol**2 / n
    assert angle == pytest.approx(0.5 * inertia * spin**2 / n + creep, abs=1e-9)
    assert creep == pytest.approx(6.17e-7, rel=0.001)


def test_a_block_on_a_slope_creeps_where_it_should_stick():
    """v = v_tol artanh(m g sin / f_c), 0.46 mm/s for 0.43 of the friction; the load has no part."""
    scene, slope = dap.Scene(name="slope"), 0.3
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.1, 0.1))
    scene.add_vector("down", "ground", (np.cos(slope), 0.0, -np.sin(slope)))
    c, s = np.cos(slope / 2), np.sin(slope / 2)
    scene.bodies["block"].p = (c, 0.0, s, 0.0)
    scene.add_joint("tran", "way", P_i="block.O", P_j="ground.O", a_j="down",
                    A_c=((np.cos(slope), 0, -np.sin(slope)), (0, 1, 0),
                         (np.sin(slope), 0, np.cos(slope))))  # fmt: skip
    scene.add_force("weight", "g", gravity=9.81, wgt=(0.0, 0.0, -1.0))
    load = 2.0 * 9.81 * np.sin(slope)
    scene.add_force("tran_friction", "rub", P_i="block.O", a_j="down", f_c=load / 0.43,
                    v_tol=1e-3)  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, dt=0.5, integrator="radau", rtol=1e-10, atol=1e-13)
    creep = 1e-3 * np.arctanh(0.43)
    speed = np.linalg.norm(result.r[2, 0] - result.r[1, 0]) / 0.5
    assert speed == pytest.approx(creep, rel=1e-8)  # what it starts with is over in 1 ms


@pytest.mark.parametrize("fields", [{"k": 30.0}, {"function": "law"}])
def test_a_bead_on_a_turning_rod(fields):
    """m x'' = m W^2 x - k (x - x_0) - c x' + f, from x = 0, through it; all turns along."""
    m, spin, k, c, x_0, f = 2.0, 3.0, 30.0, 0.8, -0.2, 1.5
    scene = dap.Scene(name="bead")
    scene.add_body("rod", mass=1.0, Jp=(0.1, 0.2, 0.3), w=(0.0, 0.0, spin))
    scene.add_body("bead", mass=m, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 0.4), w=(0.0, 0.0, spin))
    scene.add_point("P", "rod", (0.0, 0.0, 0.4))
    scene.add_joint("rev", "axle", P_i="rod.O", P_j="ground.O", a_i="rod.z", a_j="ground.z")
    scene.add_function("a", "turning", coeff=(0.0, spin, 0.0))
    scene.add_function("a", "law", coeff=(0.0, k, 0.0))
    scene.add_joint("drive-rot", "motor", body_i="rod", body_j="ground", a_j="ground.z",
                    function="turning")  # fmt: skip
    scene.add_joint("tran", "way", P_i="bead.O", P_j="P", a_j="rod.x")
    scene.add_force("tran_sda", "spring", P_i="bead.O", P_j="P", a_j="rod.x", x_0=x_0, c=c, f_a=f,
                    **fields)  # fmt: skip
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    stiff, decay = k - m * spin**2, c / (2.0 * m)
    rest = (k * x_0 + f) / stiff
    w = np.sqrt(stiff / m - decay**2)
    wave = np.cos(w * result.t) + decay / w * np.sin(w * result.t)
    expected = rest * (1.0 - np.exp(-decay * result.t) * wave)
    angle = spin * result.t
    along = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    x = np.einsum("ij,ij->i", result.r[:, 1], along)
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("c", [0.0, 0.4])
def test_a_ball_spring_swings_about_any_axis(c):
    """J phi'' + c phi' + k phi = 0 of a body with three equal moments, about its rest.
    Up to 2.9 rad, close to half a turn."""
    J, k, phi = 0.3, 3.0, 2.9
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    rest = np.array([0.8, 0.0, 0.6, 0.0])  # Euler parameters of the orientation without moment
    turn = np.array([np.cos(phi / 2), *(np.sin(phi / 2) * axis)])
    e0, e = turn[0] * rest[0] - turn[1:] @ rest[1:], np.cross(turn[1:], rest[1:])
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(J, J, J),
                   p=(e0, *(turn[0] * rest[1:] + rest[0] * turn[1:] + e)))  # fmt: skip
    scene.add_joint("sph", "socket", P_i="ball.O", P_j="ground.O")
    scene.add_force("sph_sd", "spring", body_i="ball", body_j="ground", k=k, c=c,
                    p_c=(1.6, 0.0, -1.2, 0.0))  # fmt: skip
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    decay = c / (2.0 * J)
    w = np.sqrt(k / J - decay**2)
    swing = np.exp(-decay * result.t)
    expected = phi * swing * (np.cos(w * result.t) + decay / w * np.sin(w * result.t))
    rate = -phi * swing * k / (J * w) * np.sin(w * result.t)
    np.testing.assert_allclose(result.w[:, 0], np.outer(rate, axis), rtol=0, atol=1e-8)
    energy = 0.5 * J * rate**2 + 0.5 * k * expected**2
    np.testing.assert_allclose(result.energy.total, energy, rtol=0, atol=1e-8)


@pytest.mark.parametrize("turns", [False, True])
def test_a_torsional_spring_in_a_hinge_by_name(turns):
    """About theta_0, which is the opposite of the hinge's angle, from a pose turned by 40 deg."""
    inertia, k, theta_0 = 0.3, 7.0, -5.0 if turns else -0.5
    scene = hinge(0.0)
    scene.bodies["wheel"].rpy = (0.0, 0.0, "40 deg")
    scene.add_force("rot_sda", "spring", joint="axle", k=k, theta_0=theta_0, turns=turns)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    expected = -theta_0 * (1.0 - np.cos(np.sqrt(k / inertia) * result.t))
    np.testing.assert_allclose(result.quantity("axle.angle").values, expected, rtol=0, atol=1e-8)
    assert result.ledger["energy"].ok


def test_a_hinge_is_stopped_and_rubs_by_name():
    """Free to theta = -1, where it rebounds by e: half the speed on the way back."""
    scene = hinge(2.0)
    scene.add_force("rot_stop", "stop", joint="axle", theta_stop=-1.0, k=1e4, e=0.5)
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    np.testing.assert_allclose(result.quantity("axle.angle").values, [0.0, 0.5, 1.0, 0.75, 0.5],
                               rtol=0, atol=1e-9)  # fmt: skip
    del scene.forces["stop"]
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.3)
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    np.testing.assert_allclose(result.w[:, 0, 2], 2.0 - result.t, rtol=0, atol=1e-9)


@pytest.mark.parametrize("fields", [{"joint": "axle", "v_i": "wheel.x"}, {"v_i": "wheel.x", "v_j":
                                                                         "ground.x"}])  # fmt: skip
def test_half_of_what_an_angle_is_measured_by_is_refused(fields):
    scene = hinge(2.0)
    scene.add_force("rot_sda", "spring", k=1.0, **fields)
    with pytest.raises(dap.SceneError, match=r"give joint, or v_i and v_j|axis: is required"):
        dap.compile(scene)


@pytest.mark.parametrize("theta_0", [0.0, "90 deg"])
def test_a_force_over_the_angle_of_a_hinge(theta_0):
    """Of a wheel that turns evenly, over several turns: m x.. = k (w t + theta_0)."""
    scene, k, spin, m = hinge(20.0), 0.7, 20.0, 3.0
    scene.add_body("block", mass=m, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_joint("tran", "slide", P_i="block.O", P_j="ground.O", a_j="ground.x")
    scene.add_function("a", "gas", coeff=(0.0, k, 0.0))
    scene.add_force("angle_force", "push", joint="slide", hinge="axle", function="gas",
                    theta_0=theta_0)  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    t, first = result.t, 0.0 if theta_0 == 0.0 else np.pi / 2.0
    expected = 1.0 + k / m * (spin * t**3 / 6.0 + first * t**2 / 2.0)
    np.testing.assert_allclose(result.r[:, 1, 0], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result.w[:, 0, 2], spin, rtol=0, atol=1e-10)
    assert result.ledger["energy"].ok
