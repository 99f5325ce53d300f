"""Reference for the model `A05`, the stiff flyball governor: three coordinates in closed form.
Both arms stand at the same angle beta below the horizontal, the slider at the height s, and all
turns at the rate L / J(beta), L the angular momentum about the shaft, which is kept. Lagrange's
equations for beta and s follow by hand. The reactions are those that Newton's law needs for this
motion (20 unknowns, 24 equations). `simulated` is the whole mechanism once more
in the generic simulator `kkt`."""

from functools import cache

import numpy as np
from kkt import GROUND, Body, Fixed, Spring, System, rev
from kkt_joints import tran
from rigid import GRAVITY, Array, Trajectory, Z, product, turn

DENSITY, SIDE, TIP = 3000.0, 0.01, 5.0
ROD = DENSITY * SIDE**2  # mass of the shaft, and of an arm without its tip; both are 1 m long
SLIDER, EDGE, HINGE, TOP, HALF = DENSITY * 0.1**3, 0.1, 0.05, 1.0, 0.5
STIFFNESS, DAMPING, LENGTH = 8e5, 4e4, 0.5
BETA, S0, RATE = np.pi / 6, 0.5, 2 * np.pi

ARM = ROD + TIP
CENTRE = (ROD * HALF + TIP * 1.0) / ARM  # from the hinge to the mass centre of an arm
AXIAL = ROD * SIDE**2 / 6
ACROSS = ROD * (1 + SIDE**2) / 12
ARM_ACROSS = ACROSS + ROD * (CENTRE - HALF) ** 2 + TIP * (1 - CENTRE) ** 2
BLOCK = SLIDER * EDGE**2 / 6
ABOUT_HINGE = ARM_ACROSS + ARM * CENTRE**2


def inertia(beta: float) -> tuple[float, float]:
    """Return the moment of inertia of everything about the shaft, and its derivative by beta."""
    c, s = np.cos(beta), np.sin(beta)
    radius = HINGE + CENTRE * c
    arm = ARM * radius**2 + ARM_ACROSS * c * c + AXIAL * s * s
    slope = -2 * ARM * radius * CENTRE * s + 2 * (AXIAL - ARM_ACROSS) * c * s
    return AXIAL + BLOCK + 2 * arm, 2 * slope


MOMENTUM = inertia(BETA)[0] * RATE


def spring(beta: float, s: float) -> tuple[float, float, float]:
    """Return the length of a spring and its derivatives by beta and s."""
    c = np.cos(beta)
    rise = TOP - HALF * np.sin(beta) - s
    length = np.hypot(HALF * c, rise)
    by_beta = (-(HALF**2) * c * np.sin(beta) - HALF * c * rise) / length
    return length, by_beta, -rise / length


def second(y: Array) -> tuple[float, float]:
    """Return the second derivatives of beta and s."""
    beta, s, beta_dot, s_dot = y[1:5]
    J, slope = inertia(beta)
    length, by_beta, by_s = spring(beta, s)
    F = STIFFNESS * (length - LENGTH) + DAMPING * (by_beta * beta_dot + by_s * s_dot)
    whirl = 0.5 * slope * (MOMENTUM / J) ** 2
    weight = 2 * ARM * GRAVITY * CENTRE * np.cos(beta)
    beta_ddot = (whirl + weight - 2 * F * by_beta) / (2 * ABOUT_HINGE)
    return beta_ddot, -GRAVITY - 2 * F * by_s / SLIDER


@cache
def trajectory() -> Trajectory:
    """Return the motion of (angle of the shaft, beta, s, beta_dot, s_dot)."""

    def rhs(_: float, y: Array) -> Array:
        return np.array([MOMENTUM / inertia(y[1])[0], y[3], y[4], *second(y)])

    return Trajectory(rhs, np.array([0.0, BETA, S0, 0.0, 0.0]))


def bodies(y: Array) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of shaft, both arms and slider."""
    phi, beta, s, beta_dot, s_dot = y
    beta_ddot, s_ddot = second(y)
    J, slope = inertia(beta)
    rate = MOMENTUM / J
    faster = -rate * slope * beta_dot / J
    out, aside = np.array([np.cos(phi), np.sin(phi), 0.0]), np.array([-np.sin(phi), np.cos(phi), 0])
    whole, still = turn(Z, phi), np.zeros(3)
    parts = [(0.5 * Z, whole, still, rate * Z, still, faster * Z)]
    c, sin = np.cos(beta), np.sin(beta)
    radius, radius_dot = HINGE + CENTRE * c, -CENTRE * sin * beta_dot
    radius_ddot = -CENTRE * (c * beta_dot**2 + sin * beta_ddot)
    rise_ddot = CENTRE * (sin * beta_dot**2 - c * beta_ddot)
    for side in (1.0, -1.0):
        e, n = side * out, side * aside  # outward, and where that turns to
        y_axis = aside
        p = product(whole, turn(np.array([0.0, 1.0, 0.0]), beta if side > 0 else np.pi - beta))
        v = radius_dot * e + radius * rate * n - CENTRE * c * beta_dot * Z
        w = rate * Z + side * beta_dot * y_axis
        v_dot = (radius_ddot - radius * rate**2) * e + rise_ddot * Z
        v_dot = v_dot + (2 * radius_dot * rate + radius * faster) * n
        w_dot = faster * Z + side * (beta_ddot * y_axis - beta_dot * rate * out)
        parts.append((radius * e + (TOP - CENTRE * sin) * Z, p, v, w, v_dot, w_dot))
    parts.append((s * Z, whole, s_dot * Z, rate * Z, s_ddot * Z, faster * Z))
    r, p, v, w, v_dot, w_dot = (np.array(x) for x in zip(*parts, strict=True))
    return r, p, np.hstack([v, w]), np.hstack([v_dot, w_dot])


def system() -> System:
    """Return the mechanism in space, at the start."""
    r, p, v, _ = bodies(np.array([0.0, BETA, S0, 0.0, 0.0]))
    arm = (AXIAL, ARM_ACROSS, ARM_ACROSS)
    about = ((ACROSS, ACROSS, AXIAL), arm, arm, (BLOCK,) * 3)
    names, masses = ("shaft", "right", "left", "slider"), (ROD, ARM, ARM, SLIDER)
    parts = [
        Body(names[k], masses[k], about[k], *(tuple(map(float, x)) for x in
             (r[k], p[k], v[k, :3], v[k, 3:])))
        for k in range(4)
    ]  # fmt: skip
    z, y = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
    joints = [
        rev("base", Fixed(0, (0.0, 0.0, -0.5)), Fixed(GROUND, (0.0, 0.0, 0.0)), Fixed(0, z),
            Fixed(GROUND, z)),
        rev("hinge1", Fixed(1, (-CENTRE, 0.0, 0.0)), Fixed(0, (HINGE, 0.0, 0.5)), Fixed(1, y),
            Fixed(0, y)),
        rev("hinge2", Fixed(2, (-CENTRE, 0.0, 0.0)), Fixed(0, (-HINGE, 0.0, 0.5)), Fixed(2, y),
            Fixed(0, y)),
        tran("slide", Fixed(3, (0.0, 0.0, 0.0)), Fixed(0, (0.0, 0.0, 0.0)), Fixed(0, z)),
    ]  # fmt: skip
    springs = [
        Spring(Fixed(3, (x, 0.0, 0.0)), Fixed(arm, (HALF - CENTRE, 0.0, 0.0)), STIFFNESS, LENGTH,
               DAMPING)
        for x, arm in ((HINGE, 1), (-HINGE, 2))
    ]  # fmt: skip
    return System(parts, joints, springs=springs)


SYSTEM = system()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    y = trajectory().at(t)
    r, p, v, v_dot = bodies(y)
    return SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator(1e-12, 1e-14)
