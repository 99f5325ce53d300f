"""Welds, driven legs and periodic splines against other ways to the same motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from support.rotations import rotation

import dap3d_core as dap

G = 9.81


def steiner(m, d):
    return m * (d @ d * np.eye(3) - np.outer(d, d))


@pytest.mark.parametrize(
    ("method", "integrator"), [("standard", "dop853"), ("joint", "dop853"), ("standard", "radau")]
)
def test_two_welded_bodies_fly_as_one(method, integrator):
    """The free motion of the compound body, of summed mass and inertia, is theirs.
    Steps at 1e-11 over 1 s leave less than 1e-8 of the motion."""
    m, J = np.array([2.0, 0.7]), np.array([[0.3, 0.2, 0.1], [0.05, 0.02, 0.04]])
    p2 = np.array([0.5, -0.5, 0.1, 0.7]) / np.linalg.norm([0.5, -0.5, 0.1, 0.7])
    r = np.array([[0.0, 0.0, 0.0], [0.4, -0.2, 0.3]])
    w = np.array([1.0, -2.0, 3.0])
    centre = m @ r / m.sum()
    A = rotation(p2)
    inertia = np.diag(J[0]) + steiner(m[0], r[0] - centre)
    inertia = inertia + A @ np.diag(J[1]) @ A.T + steiner(m[1], r[1] - centre)

    two, one = dap.Scene(name="two"), dap.Scene(name="one")
    two.add_body("a", mass=m[0], Jp=J[0], r=r[0], r_dot=np.cross(w, r[0] - centre), w=w)
    two.add_body("b", mass=m[1], Jp=J[1], r=r[1], p=p2, r_dot=np.cross(w, r[1] - centre), w=w)
    two.add_joint("weld", "seam", body_i="b", body_j="a")
    one.add_body("whole", mass=m.sum(), Jp=inertia, r=centre, w=w)
    settings = {"t_end": 1.0, "dt": 0.25, "rtol": 1e-11, "atol": 1e-13}
    got = dap.simulate(two, method=method, integrator=integrator, **settings)
    want = dap.simulate(one, **settings)
    turned = np.array([rotation(p) @ (r[1] - centre) for p in want.p[:, 0]])
    np.testing.assert_allclose(got.r[:, 1], want.r[:, 0] + turned, atol=1e-8)
    np.testing.assert_allclose(got.w, np.repeat(want.w, 2, axis=1), atol=1e-7)
    # the seam accelerates the smaller body
    force = got.reaction("seam")["i"].force
    np.testing.assert_allclose(force, m[1] * got.rdd[:, 1], atol=1e-8)


def test_a_weld_to_ground_carries_the_load():
    """A bracket under its weight: the force and the moment of a cantilever, to rounding."""
    scene = dap.Scene(name="bracket")
    scene.add_body("arm", mass=3.0, Jp=[0.1, 0.1, 0.1], r=[0.5, 0.0, 1.0])
    scene.add_joint("weld", "wall", body_i="arm", body_j="ground")
    scene.add_force("weight", "g", gravity=G)
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    np.testing.assert_allclose(result.r[-1, 0], [0.5, 0.0, 1.0], atol=1e-14)
    on_ground = result.reaction("wall")["j"]
    np.testing.assert_allclose(on_ground.force, [[0.0, 0.0, -3.0 * G]] * 2, atol=1e-11)
    np.testing.assert_allclose(on_ground.moment, [[0.0, 0.5 * 3.0 * G, 0.0]] * 2, atol=1e-11)


@pytest.mark.parametrize(
    ("method", "integrator"), [("standard", "dop853"), ("lsq", "adams"), ("standard", "radau")]
)
@pytest.mark.parametrize("length", [1.0, None])
def test_a_pendulum_on_a_driven_leg(length, method, integrator):
    """l theta'' = -g sin theta - 2 l' theta', with l = 1 + 0.2 sin 5 t, by SciPy at 1e-13."""
    scene = dap.Scene(name="pumped")
    start = 0.4
    scene.add_body("bob", mass=1.5, Jp=[0.1, 0.1, 0.1], r=[np.sin(start), 0.0, -np.cos(start)])
    scene.add_function("harmonic", "pump", amplitude=0.2, frequency=5.0)
    scene.add_joint("sph-sph", "leg", P_i="bob.O", P_j="ground.O", length=length, function="pump")
    scene.add_force("weight", "g", gravity=G)

    def slope(t, y):
        l, rate = 1.0 + 0.2 * np.sin(5.0 * t), np.cos(5.0 * t)
        return [y[1], (-G * np.sin(y[0]) - 2.0 * rate * y[1]) / l]

    found = solve_ivp(slope, (0.0, 1.0), [start, 0.0], "DOP853", rtol=1e-13, atol=1e-13)
    theta, spin = found.y[:, -1]
    result = dap.simulate(scene, t_end=1.0, dt=1.0, method=method, integrator=integrator,
                          rtol=1e-11, atol=1e-13)  # fmt: skip
    l = 1.0 + 0.2 * np.sin(5.0)
    np.testing.assert_allclose(result.r[-1, 0], [l * np.sin(theta), 0.0, -l * np.cos(theta)],
                               atol=2e-9)  # fmt: skip
    # the tension carries the weight along the leg and what turns and lengthens it
    tension = 1.5 * (G * np.cos(theta) + l * spin**2 + 5.0 * np.sin(5.0))
    np.testing.assert_allclose(-result.Lam[-1] * l, [tension], atol=1e-6)
    assert result.ledger["energy"].ok


def test_inverse_dynamics_of_a_leg():
    """A weight lifted straight up: the force of the leg is m (g + a), a push."""
    scene = dap.Scene(name="lift")
    scene.add_body("load", mass=2.0, Jp=[0.1, 0.1, 0.1], r=[0.0, 0.0, 1.0])
    scene.add_function("a", "rise", coeff=[0.0, 0.0, 0.5])
    scene.add_joint("sph-sph", "leg", P_i="load.O", P_j="ground.O",
                    length=1.0, function="rise")  # fmt: skip
    for axis in "xy":
        scene.add_joint("rP", f"guide_{axis}", body_i="load", a_j=f"ground.{axis}", length=0.0)
    scene.add_force("weight", "g", gravity=G)
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    np.testing.assert_allclose(result.r[:, 0, 2], 1.0 + 0.5 * result.t**2, atol=1e-10)
    np.testing.assert_allclose(result.reaction("leg")["i"].force[:, 2], 2.0 * (G + 1.0), atol=1e-9)
    back = dap.inverse(scene, result, actuators=["leg"])
    np.testing.assert_allclose(back.quantity("leg.actuation").values, 2.0 * (G + 1.0), atol=1e-6)
    np.testing.assert_allclose(back.Lam, result.Lam, atol=1e-6)


@pytest.mark.parametrize("rise", [0.0, 0.7])
def test_a_periodic_spline(rise):
    """SciPy's periodic spline and a straight line, over three periods before and after the first.
    What the slider does is the function and its derivatives, to rounding of arguments up to 10."""
    x = np.array([0.3, 0.9, 1.4, 2.0, 2.3, 3.1])
    y = np.array([0.0, 0.4, 0.1, -0.3, 0.2, rise])
    slope = rise / (x[-1] - x[0])
    rest = y - slope * (x - x[0])
    rest[-1] = rest[0]
    want = CubicSpline(x, rest, bc_type="periodic", extrapolate="periodic")
    scene = dap.Scene(name="cam")
    scene.add_body("slider", mass=1.0, Jp=[0.1, 0.1, 0.1])
    scene.add_function("spline", "cam", x=list(x), y=list(y), periodic=True)
    scene.add_joint("rP", "drive", body_i="slider", a_j="ground.z", length=0.0, function="cam")
    result = dap.simulate(scene, t_end=9.0, dt=0.13)
    t = result.t
    np.testing.assert_allclose(result.r[:, 0, 2], want(t) + slope * (t - x[0]), atol=1e-12)
    np.testing.assert_allclose(result.rd[:, 0, 2], want(t, 1) + slope, atol=1e-11)
    np.testing.assert_allclose(result.rdd[:, 0, 2], want(t, 2), atol=1e-10)
