"""Types with states of their own, and scenes with them, for tests."""

import numpy as np

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Joint, body, number
from dap3d_core.kernels import eye, scale, sub
from support.own_types import registry_of

ZERO = (0.0, 0.0, 0.0)
#: Of the Maxwell element in ``pulled``: stiffness, damping, rest length, mass, start.
K, C, L0, MASS, X0, Z0 = 50.0, 3.0, 1.0, 2.0, 1.5, 0.1


class Lag(Force):
    """A force that follows -k r with a lag, component by component, and counts its own time.

    held_dot = (-k r - held) / tau, clock_dot = 1
    """

    keyword = "test-lag"
    states = {"held": 3, "clock": 1}  # noqa: RUF012
    body_i: Body = body()
    k: float = number(unit="N/m")
    tau: float = number(unit="s", positive=True)

    def rate(r_i, held, k, tau):
        return scale(1.0 / tau, sub(scale(-k, r_i), held)), 1.0

    def wrench(held):
        return held, ZERO


class Steered(Joint):
    """Drives the velocity of a body along x to a state that relaxes to a target.

    z_dot = (target - z) / tau; row: v_x - z = 0
    """

    keyword, rows, holonomic = "test-steered", 1, False
    states = ("z",)
    body_i: Body = body()
    target: float = number(unit="m/s")
    tau: float = number(unit="s", positive=True)

    def J():
        return (eye(1.0)[0] + ZERO,)

    def rate(z, target, tau):
        return (target - z) / tau

    def nu(z):
        return z

    def gamma(z, target, tau):
        return (target - z) / tau


REGISTRY = registry_of(Lag, Steered)


def pulled(**fields):
    """A body pulled to the origin along x by a Maxwell element."""
    scene = dap.Scene(name="pulled")
    scene.add_body("cart", mass=MASS, Jp=(1.0, 1.0, 1.0), r=(X0, 0.0, 0.0))
    given = {"k": K, "c": C, "l0": L0, "z_0": Z0} | fields
    scene.add_force("maxwell", "spring", P_i="cart.O", P_j="ground.O", **given)
    return scene


def steered():
    """A cart that is driven at a velocity that is a state."""
    scene = dap.Scene(name="steered")
    scene.add_body("cart", mass=2.0, Jp=(1.0, 1.0, 1.0), r_dot=(0.5, 0.0, 0.0))
    scene.add_joint("test-steered", "wheel", body_i="cart", target=2.0, tau=0.25, z_0=0.5)
    return scene


def stated():
    """A cart and a rod on a pin, with two forces that have states, of standard types."""
    scene = dap.Scene(name="stated")
    scene.add_body("cart", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.5, 0.0, 0.0))
    scene.add_body("rod", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.5, 0.0))
    scene.add_point("end", "rod", (0.0, -0.5, 0.0))
    scene.add_joint("rev", "pin", P_i="end", P_j="ground.O", a_i="rod.z", a_j="ground.z")
    scene.add_force("maxwell", "spring", P_i="cart.O", P_j="rod.O", k=50.0, c=3.0, k_p=5.0,
                    l0=1.0, z_0=0.1)  # fmt: skip
    scene.add_force("bouc-wen", "loop", P_i="cart.O", P_j="ground.O", k=20.0, beta=2.0, gamma=0.5,
                    n=1.5, l0=1.0, z_0=0.05)  # fmt: skip
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def pulled_exactly(t):
    """x (nt,), v (nt,), z (nt,) of ``pulled``: linear, by the exponential of its matrix."""
    A = np.array([[0.0, 1.0, 0.0], [-K / MASS, 0.0, K / MASS], [K / C, 0.0, -K / C]])
    values, vectors = np.linalg.eig(A)
    parts = np.linalg.solve(vectors, np.array([X0 - L0, 0.0, Z0], dtype=complex))
    found = (vectors @ (parts[:, None] * np.exp(values[:, None] * np.asarray(t)))).real
    return found[0] + L0, found[1], found[2]
