"""Each scene against its closed form (docs/ derives them).

Tolerances follow from the run's own, rtol 1e-10, but where the closed form itself is one of small
motions: that is said there.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import dap3d_core as dap

SCENES = Path(__file__).parents[1] / "scenes"


def run(name, **changes):
    """The result of a scene of this package, run precisely."""
    scene = dap.load(SCENES / f"{name}.toml")
    return dap.simulate(scene, **({"rtol": 1e-10, "atol": 1e-12} | changes))


def test_a_block_on_a_wedge():
    """Newton's law for both, along and across the slope: all accelerations are constant."""
    result = run("point-on-plane")
    m, M, sine, cosine, g = 1.0, 3.0, 0.6, 0.8, 9.81
    of_wedge = -m * g * sine * cosine / (M + m * sine**2)
    along = (M + m) * g * sine / (M + m * sine**2)
    half = 0.5 * result.t**2
    np.testing.assert_allclose(result.r[:, 0, 0], of_wedge * half, atol=1e-9)
    np.testing.assert_allclose(result.r[:, 1, 0], (of_wedge + along * cosine) * half, atol=1e-9)
    np.testing.assert_allclose(result.r[:, 1, 2], -along * sine * half, atol=1e-9)


def test_a_bead_in_a_bowl():
    """The bottom rises by c x^2 / (2 a^2) + c y^2 / (2 b^2): omega = sqrt(g c) / a and / b.

    The next terms are (amplitude / a)^2, 1e-7 here, times the phase of some 10 rad.
    """
    result = run("point-on-surface")
    for k, semi_axis in enumerate((0.3, 0.2)):
        omega = np.sqrt(9.81 * 0.15) / semi_axis
        swing = 1e-3 / omega
        wanted = swing * np.sin(omega * result.t)
        np.testing.assert_allclose(result.r[:, 0, k], wanted, atol=1e-5 * swing)


def test_a_free_bead_runs_along_a_geodesic():
    """Joachimsthal: sum(x_k^2 / a_k^4) sum(v_k^2 / a_k^2) is constant along a geodesic, as is |v|.

    On an ellipsoid with three different axes, some 14 times around; to the tolerance of the run
    1e-11 a step, over some 1e3 steps. A sphere's geodesic is a great circle.
    """
    for semi_axes in ((0.3, 0.2, 0.15), (0.2, 0.2, 0.2)):
        scene = dap.Scene(name="geodesic")
        scene.add_body("bead", mass=0.1, Jp=(1e-5,) * 3, r=(semi_axes[0], 0.0, 0.0),
                       r_dot=(0.0, 0.6, 0.8))  # fmt: skip
        a, b, c = semi_axes
        pole = scene.add_point("pole", "ground", (0.0, 0.0, -c))  # the centre is the origin
        scene.add_joint("point-on-surface", P_i="bead.O", P_j=pole, a=a, b=b, c=c)
        result = dap.simulate(scene, t_end=20.0, dt=0.1, rtol=1e-11, atol=1e-13)
        x, v, s = result.r[:, 0], result.rd[:, 0], np.array(semi_axes)
        np.testing.assert_allclose(np.sum((x / s) ** 2, axis=1), 1.0, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1.0, atol=1e-8)
        invariant = np.sum(x**2 / s**4, axis=1) * np.sum(v**2 / s**2, axis=1)
        np.testing.assert_allclose(invariant, invariant[0], rtol=1e-7)
    angle = result.t / 0.2
    circle = 0.2 * np.column_stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    np.testing.assert_allclose(x, circle, atol=1e-7)


def test_a_motor_at_its_limit():
    """J e' = -T tanh(k e / T) for the error e of the speed: sinh(k e / T) ~ exp(-k t / J)."""
    result = run("position-servo")
    start = np.sinh(0.5 * 20.0 / 2.0)
    error = 2.0 / 0.5 * np.arcsinh(start * np.exp(-0.5 / 0.1 * result.t))
    np.testing.assert_allclose(result.w[:, 0, 2], 20.0 - error, atol=1e-7)


def test_a_controller_with_integral_part():
    """J e'' + gain e' + integral e = 0 for the error e of the angle, e' = 20 at the start.

    The limit is 5e4 times the torque needed: it changes the torque by 1e-10 of it.
    """
    result = run("position-servo")
    gain, integral, inertia = 0.1, 0.5, 0.02
    decay = gain / (2.0 * inertia)
    omega = np.sqrt(integral / inertia - decay**2)
    t = result.t
    wave = np.cos(omega * t) - decay / omega * np.sin(omega * t)
    np.testing.assert_allclose(
        result.w[:, 1, 2], 20.0 - 20.0 * np.exp(-decay * t) * wave, atol=1e-7
    )


PRECISE = {"rtol": 1e-12, "atol": {"r": 1e-14, "p": 1e-14, "v": 1e-14, "w": 1e-14, "z": 1e-14}}


def reference(rates, start, t):
    """Solution (n, nt) of equations of its own, by SciPy at 1e-13, without interpolation."""
    found = [np.array(start)]
    for span in pairwise(t):
        end = solve_ivp(rates, span, found[-1], "DOP853", rtol=1e-13, atol=1e-15)
        found.append(end.y[:, -1])
    return np.array(found).T


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_a_hydraulic_cylinder(integrator):
    """x, v and both pressures; 1e-9 of the largest of each."""
    result = run("cylinder", **PRECISE, integrator=integrator)

    def rates(t, y):
        x, v, p_a, p_b = y
        s, q = x - 0.5, 1e-4 * np.sin(2.0 * np.pi * t) - 1e-12 * (p_a - p_b)
        of_a = 1e8 * (q - 2e-3 * v) / (1e-4 + 2e-3 * s)
        of_b = 1e8 * (1e-3 * v - q) / (1e-4 + 1e-3 * (0.8 - s))
        return v, (2e-3 * p_a - 1e-3 * p_b) / 200.0, of_a, of_b

    want = reference(rates, (0.9, 0.0, 1e6, 2e6), result.t)
    for name, y in zip(("sledge.r.x", "sledge.rd.x", "lift.p_a", "lift.p_b"), want, strict=True):
        got = result.quantity(name).values
        np.testing.assert_allclose(got, y, rtol=0.0, atol=1e-9 * np.max(np.abs(y)))


def test_a_pi_controller_carries_a_load():
    """J w' = gain e + integral z - load, z' = e: z -> load / integral, by the exponential."""
    result = run("servo", **PRECISE)
    J, gain, integral, load, speed = 0.1, 0.4, 1.5, 0.6, 30.0
    A = np.array([[-gain / J, integral / J], [-1.0, 0.0]])
    rest = np.array([speed, load / integral])
    want = np.array([rest - expm(A * t) @ rest for t in result.t])
    np.testing.assert_allclose(result.w[:, 0, 2], want[:, 0], atol=1e-9)
    np.testing.assert_allclose(result.quantity("drive.z").values, want[:, 1], atol=1e-9)
    lin = dap.linearize(SCENES / "servo.toml", at=result, t=float(result.t[-1]))
    poles = np.sort_complex(np.roots([J, gain, integral]))
    found = lin.eigenvalues[np.abs(lin.eigenvalues) > 1e-6]
    np.testing.assert_allclose(np.sort_complex(found), poles, rtol=1e-10)


def test_a_tyre_builds_up_its_side_force():
    """v_y and the slip angle, at constant v_x; the force acts at the mass centre."""
    result = run("tyre", **PRECISE)

    def rates(t, y):
        force = 2700.0 * np.tanh(40000.0 * y[1] / 2700.0)
        return force / 300.0, -(y[0] + 15.0 * y[1]) / 0.6

    v_y, alpha = reference(rates, (2.0, 0.0), result.t)
    np.testing.assert_allclose(result.quantity("sledge.rd.y").values, v_y, atol=1e-9)
    np.testing.assert_allclose(result.quantity("wheel.alpha").values, alpha, atol=1e-9)


def test_a_clutch_takes_a_flywheel_along():
    """J_1 w_1 + J_2 w_2 = M t; the twist: m x'' + c x' + k x = M m / J_1, from rest, m reduced."""
    result = run("clutch", rtol=1e-12)
    J1, J2, M, k, c, t_on = 0.2, 0.8, 3.0, 400.0, 2.0, 0.5
    w1, w2 = result.w[:, 0, 2], result.w[:, 1, 2]
    np.testing.assert_allclose(J1 * w1 + J2 * w2, M * result.t, atol=1e-9)
    (jump,) = result.events
    assert jump.t == pytest.approx(t_on, abs=1e-12)
    after = np.array(jump.u_after)[[19, 25]]
    np.testing.assert_allclose(after, M * t_on / (J1 + J2), atol=1e-10)
    m = J1 * J2 / (J1 + J2)
    decay, x0 = c / (2.0 * m), M * m / J1 / k
    w = np.sqrt(k / m - decay**2)
    t = result.t[result.t >= jump.t] - jump.t
    x = x0 * (1.0 - np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t)))
    twist = result.quantity("clutch.twist").values
    np.testing.assert_allclose(twist[result.t >= jump.t], x, atol=1e-10)
    assert result.ledger["energy"].ok


def test_a_charge_parts_a_rocket_from_its_tank():
    """Velocities P / m, angular velocities (arm x P) / J at the instant; momentum is kept."""
    result = run("stage")
    (jump,) = result.events
    v = np.array(jump.u_after)[14:].reshape(2, 2, 3)
    np.testing.assert_allclose(v[:, 0, 2], [50.0 + 12.0 / 2.0, 50.0 - 12.0 / 6.0], atol=1e-12)
    np.testing.assert_allclose(v[:, 1, 1], [-0.1 * 12.0 / 1.0, 0.1 * 12.0 / 2.0], atol=1e-12)
    momentum = np.einsum("b,tbk->tk", [2.0, 6.0], result.rd)
    np.testing.assert_allclose(momentum, np.tile([0.0, 0.0, 400.0], (len(result.t), 1)), atol=1e-9)


def test_an_engine_runs_up_by_its_map():
    """J w' = u (20 - w / 10) with u = 1/2, then 1 from t = 1 on; its pole is -u / (10 J)."""
    opened = dap.Controller(every=1.0, update=lambda t, _: {"throttle": 0.5 if t < 0.5 else 1.0})
    result = run("engine", rtol=1e-12, controllers=[opened])
    half = 200.0 * (1.0 - np.exp(-0.5 * np.minimum(result.t, 1.0)))
    wanted = 200.0 - (200.0 - half) * np.exp(-np.maximum(result.t - 1.0, 0.0))
    np.testing.assert_allclose(result.w[:, 0, 2], wanted, atol=1e-9)
    lin = dap.linearize(dap.load(SCENES / "engine.toml"), inputs=["throttle"])
    poles = lin.eigenvalues[np.abs(lin.eigenvalues) > 1e-6]
    np.testing.assert_allclose(poles, [-0.5], rtol=1e-12)
    # in coordinates of unit mass
    np.testing.assert_allclose(np.max(np.abs(lin.B)), 20.0 / np.sqrt(0.1), rtol=1e-12)


def test_a_slider_is_lifted_by_a_cycloidal_cam():
    """f = rise (u - sin(2 pi u) / (2 pi)), its derivatives; the driver does m g rise."""
    result = run("cycloid")
    u = np.clip((result.t - 0.5) / 0.5, 0.0, 1.0)
    a = 2.0 * np.pi * u
    np.testing.assert_allclose(result.r[:, 0, 2], 0.1 * (u - np.sin(a) / (2 * np.pi)), atol=1e-12)
    np.testing.assert_allclose(result.rd[:, 0, 2], 0.2 * (1.0 - np.cos(a)), atol=1e-11)
    np.testing.assert_allclose(result.rdd[:, 0, 2], 0.8 * np.pi * np.sin(a), atol=1e-10)
    force = result.reaction("lift")["i"].force[:, 2]
    np.testing.assert_allclose(force, 2.0 * (9.81 + 0.8 * np.pi * np.sin(a)), atol=1e-9)
    potential = result.energy.potential[-1] - result.energy.potential[0]
    assert potential == pytest.approx(2.0 * 9.81 * 0.1, rel=1e-10)
