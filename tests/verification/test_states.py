"""States of elements against exact solutions, by every formulation and integrator."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from support.own_types import registry_of
from support.problems import four_bar
from support.state_types import REGISTRY, ZERO, pulled, pulled_exactly, steered

import dap3d_core as dap
from dap3d_core.interface import number
from dap3d_core.kernels import abs, dot, neg, scale, sqrt, sub
from dap3d_joints.revolute import Revolute

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
    compiled = dap.compile(steered(), registry=REGISTRY)
    result = dap.simulate(compiled, t_end=1.0, dt=0.25, **TIGHT)
    fall = np.exp(-result.t / 0.25)
    assert result.quantity("wheel.z").values == pytest.approx(2.0 - 1.5 * fall, abs=1e-10)
    x = 2.0 * result.t - 1.5 * 0.25 * (1.0 - fall)
    assert result.quantity("cart.r.x").values == pytest.approx(x, abs=1e-10)
    power = result.quantity("wheel.force.x").values
    assert power == pytest.approx(2.0 * 1.5 / 0.25 * fall, abs=1e-8)


def reference(rates, start, t):
    """Solution (n, nt) of equations of its own, by SciPy at 1e-13, without interpolation."""
    found = [np.array(start)]
    for span in pairwise(t):
        end = solve_ivp(rates, span, found[-1], "DOP853", rtol=1e-13, atol=1e-15)
        found.append(end.y[:, -1])
    return np.array(found).T


def sliding_mass(force, x=1.5, v=0.0, **fields):
    """A mass of 2 kg on the x axis with a force to ground."""
    scene = dap.Scene(name="sliding mass")
    scene.add_body("cart", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(x, 0.0, 0.0), r_dot=(v, 0.0, 0.0))
    ends = {"P_i": "cart.O"} | ({} if "a_j" in fields else {"P_j": "ground.O"})
    scene.add_force(force, "element", **ends, **fields)
    return scene


PRECISE = {"rtol": 1e-12, "atol": 1e-14}


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_the_standard_linear_solid(integrator):
    """maxwell with a spring beside it: the exponential of its matrix, to 1e-9."""
    k, c, k_p, mass = 80.0, 4.0, 30.0, 2.0
    scene = sliding_mass("maxwell", k=k, c=c, k_p=k_p, l0=1.0, z_0=0.1)
    result = dap.simulate(scene, t_end=2.0, dt=0.1, integrator=integrator, **PRECISE)
    A = np.array([[0.0, 1.0, 0.0], [-(k + k_p) / mass, 0.0, k / mass], [k / c, 0.0, -k / c]])
    want = np.array([expm(A * t) @ (0.5, 0.0, 0.1) for t in result.t])
    assert result.quantity("cart.r.x").values - 1.0 == pytest.approx(want[:, 0], abs=1e-9)
    assert result.quantity("element.z").values == pytest.approx(want[:, 2], abs=1e-9)
    elongation = want[:, 0] - want[:, 2]
    energy = 0.5 * (k * elongation**2 + k_p * want[:, 0] ** 2)
    assert result.quantity("element.energy").values == pytest.approx(energy, abs=1e-8)


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_hysteresis_of_bouc_and_wen(integrator):
    """x, v and z of the same equations in SciPy, to 1e-9."""
    k, alpha, beta, gamma, n = 100.0, 0.2, 30.0, 10.0, 2.0
    fields = {"k": k, "alpha": alpha, "beta": beta, "gamma": gamma, "n": n, "l0": 1.0}
    result = dap.simulate(
        sliding_mass("bouc-wen", **fields), t_end=2.0, dt=0.1, integrator=integrator, **PRECISE
    )

    def rates(t, y):
        x, v, z = y
        force = k * (alpha * (x - 1.0) + (1.0 - alpha) * z)
        return v, -force / 2.0, v - abs(z) ** (n - 1.0) * (beta * abs(v) * z + gamma * v * abs(z))

    x, v, z = reference(rates, (1.5, 0.0, 0.0), result.t)
    assert result.quantity("cart.r.x").values == pytest.approx(x, abs=1e-9)
    assert result.quantity("cart.rd.x").values == pytest.approx(v, abs=1e-9)
    assert result.quantity("element.z").values == pytest.approx(z, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["radau", "auto"])
def test_friction_of_bristles(integrator):
    """LuGre: a mass on a spring slides, turns back, and comes to rest with bent bristles."""
    law = {"f_n": 20.0, "mu_c": 0.3, "mu_s": 0.5, "v_s": 0.05, "sigma_0": 2e4, "sigma_1": 50.0,
           "sigma_2": 1.0}  # fmt: skip
    scene = sliding_mass("lugre", x=1.4, a_j="ground.x", **law)
    scene.add_force("ptp", "spring", P_i="cart.O", P_j="ground.O", k=100.0, l0=1.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.05, integrator=integrator, **PRECISE)

    def rates(t, y):
        x, v, z = y
        g = 20.0 * (0.3 + 0.2 * np.exp(-((v / 0.05) ** 2)))
        z_dot = v - 2e4 * abs(v) * z / g
        friction = 2e4 * z + 50.0 * z_dot + v
        return v, (-100.0 * (x - 1.0) - friction) / 2.0, z_dot

    x, v, z = reference(rates, (1.4, 0.0, 0.0), result.t)
    assert np.min(v) < -0.2, "it slides"
    assert result.quantity("cart.r.x").values == pytest.approx(x, abs=1e-9)
    assert result.quantity("element.z").values == pytest.approx(z, abs=1e-9)
    assert result.quantity("cart.rd.x").values == pytest.approx(v, abs=1e-9)


def test_stiff_bristles_cost_radau_few_steps():
    """Bristles a thousand times stiffer cost at most twice the steps of radau, each with some
    seven iterations of up to seven stages."""
    steps = []
    for sigma_0 in (1e5, 1e8):
        law = {"f_n": 20.0, "mu_c": 0.3, "mu_s": 0.5, "v_s": 0.05, "sigma_0": sigma_0}
        scene = sliding_mass("lugre", x=1.4, a_j="ground.x", z_atol=1e-4 / sigma_0, **law)
        scene.add_force("ptp", "spring", P_i="cart.O", P_j="ground.O", k=100.0, l0=1.0)
        result = dap.simulate(scene, t_end=1.0, integrator="radau", rtol=1e-6)
        steps.append(result.stats.steps)
        assert result.stats.rhs < 7 * 7 * result.stats.steps
    assert steps[1] < 2 * steps[0]


@pytest.mark.parametrize("method", ["joint", "lsq", "penalty"])
def test_a_closed_loop_with_states_by_every_formulation(method):
    """A four-bar with a late spring: the state is that of method standard, by some tolerances."""

    def run(method):
        scene = four_bar()
        first, *_, last = scene.bodies
        scene.add_force("maxwell", "late", P_i=f"{first}.O", P_j=f"{last}.O", k=30.0, c=2.0)
        return dap.simulate(scene, method=method, t_end=1.0, dt=0.1, rtol=1e-10, atol=1e-12)

    want, got = run("standard"), run(method)
    assert got.method == method
    z = want.quantity("late.z").values
    assert np.ptp(z) > 0.1
    assert got.quantity("late.z").values == pytest.approx(z, abs=1e-8)


class Bearing(Revolute):
    """A hinge whose friction has bristles, and grows with the load: z_dot = w - |w| z / g."""

    keyword, states = "test-bearing", ("z",)
    stiffness: float = number()
    g: float = number(positive=True)

    def rate(a_i, w_i, w_j, z, g):
        w = dot(a_i, sub(w_i, w_j))
        return w - abs(w) * z / g

    def friction(a_i, lam, z, stiffness, mu):
        load = mu * sqrt(lam[0] * lam[0] + lam[1] * lam[1] + lam[2] * lam[2])
        moment = scale(-load * stiffness * z, a_i)
        return (ZERO, moment), (ZERO, neg(moment))


def bearings():
    """A wheel on a bearing that rubs; another that does not stands before it in the scene."""
    scene = dap.Scene(name="bearings")
    scene.add_body("wheel", mass=3.0, Jp=(0.1, 0.1, 0.2), w=(0.0, 0.0, 5.0))
    scene.add_body("other", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_point("off", "ground", (1.0, 0.0, 0.0))
    axes = {"a_j": "ground.z"}
    scene.add_joint("test-bearing", "b2", P_i="other.O", P_j="off", a_i="other.z", stiffness=1.0,
                    g=0.02, z_0=0.01, **axes)  # fmt: skip
    scene.add_joint("test-bearing", "b1", P_i="wheel.O", P_j="ground.O", a_i="wheel.z",
                    stiffness=100.0, g=0.01, **axes)  # fmt: skip
    scene.add_force("weight", "gravity")
    scene.add_force("friction", "rubbing", joint="b1", mu=0.3, v_tol=1e-3)
    return scene


@pytest.mark.parametrize(
    ("method", "integrator"),
    [("standard", "dop853"), ("standard", "radau"), ("joint", "dop853"), ("lsq", "adams")],
)
def test_friction_of_a_joint_by_its_state(method, integrator):
    """Load m g: J w' = -mu m g s z, against SciPy; the state of the other bearing stays."""
    compiled = dap.compile(bearings(), registry=registry_of(Bearing), method=method)
    result = dap.simulate(compiled, t_end=0.05, dt=0.01, integrator=integrator, **PRECISE)

    def rates(t, y):
        return -0.3 * 3.0 * 9.81 * 100.0 * y[1] / 0.2, y[0] - abs(y[0]) * y[1] / 0.01

    w, z = reference(rates, (5.0, 0.0), result.t)
    assert result.quantity("wheel.w.z").values == pytest.approx(w, abs=1e-9)
    assert result.quantity("b1.z").values == pytest.approx(z, abs=1e-10)
    assert result.quantity("b2.z").values == pytest.approx(0.01, abs=1e-15)
