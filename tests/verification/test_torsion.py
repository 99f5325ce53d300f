"""Springs about an axis (rot_sda) and springs given by a function, against closed forms.
Tolerances: rtol 1e-11 over some seconds leaves some 1e-9 of the largest angle."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dap3d_core as dap
from dap3d_forces.torsion import Torsion, wrapped

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
INERTIA = 0.3


def wheel(angle=0.0, spin=0.0):
    """A wheel on an axle along z, turned by an angle, spinning."""
    scene = dap.Scene(name="wheel")
    p = (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))
    scene.add_body("wheel", mass=2.0, Jp=(0.2, 0.2, INERTIA), p=p, w=(0.0, 0.0, spin))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    return scene


def spring(scene, **fields):
    scene.add_force("rot_sda", "spring", v_i="wheel.x", v_j="ground.x", axis="ground.z", **fields)
    return scene


def angle(result):
    """The wheel's angle, turns counted."""
    p = result.p[:, 0]
    return 2.0 * np.unwrap(np.arctan2(p[:, 3], p[:, 0]), period=np.pi)


def damped(t, x, speed, k, c):
    """The free motion of J x'' + c x' + k x = 0, below critical damping."""
    decay = c / (2.0 * INERTIA)
    w = np.sqrt(k / INERTIA - decay**2)
    return np.exp(-decay * t) * (x * np.cos(w * t) + (speed + decay * x) / w * np.sin(w * t))


@pytest.mark.parametrize(("k", "c"), [(3.0, 0.0), (3.0, 0.4)])
def test_a_torsion_pendulum(k, c):
    """The wheel swings as the damped oscillator does, about the angle of no moment.
    The angle is that of ground relative to the wheel: theta = -angle."""
    scene = spring(wheel(0.8, 2.0), k=k, c=c, theta_0=-0.3)
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    expected = 0.3 + damped(result.t, 0.5, 2.0, k, c)
    assert angle(result) == pytest.approx(expected, abs=1e-9)
    energy = 0.5 * INERTIA * result.w[:, 0, 2] ** 2 + 0.5 * k * (angle(result) - 0.3) ** 2
    assert result.energy.total == pytest.approx(energy, abs=1e-9)


def test_the_actuator_turns_the_wheel():
    """n_a is a constant moment n_a u on body i; it counts as work, not as energy."""
    result = dap.simulate(spring(wheel(), n_a=0.6), t_end=4.0, dt=0.1, **TIGHT)
    assert angle(result) == pytest.approx(0.5 * 0.6 / INERTIA * result.t**2, abs=1e-8)
    assert result.energy.potential == pytest.approx(0.0, abs=0.0)
    assert result.work == pytest.approx(0.6 * angle(result), abs=1e-8)


def test_a_spring_that_counts_turns_winds_up():
    """With turns the wheel swings 17 rad to each side, as the linear oscillator does."""
    k, spin = 0.1, 10.0
    scene = spring(wheel(0.0, spin), k=k, n_a=0.2, turns=True)
    result = dap.simulate(scene, t_end=12.0, dt=0.05, **TIGHT)
    rest = 0.2 / k  # where spring and actuator balance
    expected = rest + damped(result.t, -rest, spin, k, 0.0)
    assert np.ptp(expected) > 6.0 * np.pi
    assert angle(result) == pytest.approx(expected, abs=1e-7)
    assert result.energy.total == pytest.approx(result.energy.total[0], abs=1e-7)


def test_without_turns_the_moment_jumps_half_a_turn_away():
    """The angle less theta_0 stays in (-pi, pi] and is the true one up to whole turns."""
    u = (0.0, 0.0, 1.0)
    for theta_0 in (0.0, 2.0, -5.0):
        start = (np.cos(theta_0), np.sin(theta_0))
        for theta in np.linspace(-9.0, 9.0, 37):
            v = (np.cos(theta), np.sin(theta), 0.4)  # off the plane: projected
            found = wrapped((1.0, 0.0, -0.3), v, u, start)
            assert -np.pi < found <= np.pi
            off = (found - (theta - theta_0)) / (2.0 * np.pi)
            assert off == pytest.approx(round(off), abs=1e-14)


def test_the_moment_is_that_of_the_energy_about_the_axis():
    """-dV/dtheta = -k x for bodies that turn about the axis, by a complex step of V."""
    u, v_i, start = (0.6, 0.0, 0.8), (0.0, 1.0, 0.0), (np.cos(0.4), np.sin(0.4))
    other = np.cross(u, v_i)
    for theta in (-2.0, 0.1, 3.0):
        step = theta + 1e-20j
        v_j = tuple(np.cos(step) * np.array(v_i) + np.sin(step) * other)
        slope = Torsion.energy(v_i, v_j, u, start, 2.5).imag / 1e-20
        v_j = tuple(x.real for x in v_j)
        (_, on_i), (_, on_j) = Torsion.wrench(
            v_i, v_j, u, start, (0.0,) * 3, (0.0,) * 3, 2.5, 0.1, 0.0
        )
        assert slope == pytest.approx(2.5 * (theta - 0.4), abs=1e-12)
        assert np.dot(on_i, u) == pytest.approx(slope, abs=1e-12)
        assert on_j == pytest.approx(-np.array(on_i), abs=0.0)


def one_dimensional(law, x, speed, inertia, t):
    """The motion of inertia x'' = law(x, x'), integrated on its own."""
    found = solve_ivp(lambda _, y: (y[1], law(*y) / inertia), (0.0, t[-1]), (x, speed),
                      method="DOP853", rtol=1e-12, atol=1e-13, t_eval=t)  # fmt: skip
    return found.y[0]


@pytest.mark.parametrize("turns", [False, True])
def test_a_spring_about_an_axis_by_a_function(turns):
    """The function takes the place of k x: T = f(x) + c theta_dot + n_a, as in one dimension."""
    scene = wheel(0.7)
    scene.add_function("harmonic", "curve", amplitude=2.0, frequency=1.5)
    scene = spring(scene, c=0.1, theta_0=0.2, n_a=0.1, turns=turns, function="curve", k=99.0)
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)

    def law(x, speed):  # of the wheel: theta = -x, its moment is +T
        return 2.0 * np.sin(1.5 * (-x - 0.2)) + 0.1 * (-speed) + 0.1

    expected = one_dimensional(law, 0.7, 0.0, INERTIA, result.t)
    assert angle(result) == pytest.approx(expected, abs=1e-9)
    assert result.ledger["energy"].ok


def test_a_spring_on_a_line_by_a_function():
    """ptp: a spring table by points, hardening, moves a mass as in one dimension."""
    x = np.array([-0.5, -0.2, 0.0, 0.2, 0.5])
    y = np.array([-30.0, -8.0, 0.0, 8.0, 30.0])
    scene = dap.Scene(name="mass on a spring")
    scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.4, 0.0, 0.0))
    scene.add_function("spline", "curve", x=x, y=y)
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", l0=1.0, c=0.3, f_a=0.5,
                    function="curve", k=99.0)  # fmt: skip
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(x, y, bc_type="natural")

    def law(l, speed):
        return -(float(curve(l - 1.0)) + 0.3 * speed + 0.5)

    # the pieces of the curve meet with a jump of f''', which costs the integrators some digits
    assert result.r[:, 0, 0] == pytest.approx(
        one_dimensional(law, 1.4, 0.0, 2.0, result.t), abs=1e-8
    )
    assert result.ledger["energy"].ok
