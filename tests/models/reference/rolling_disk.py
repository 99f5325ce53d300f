"""Reference for the model `N1`, a disk that rolls in a steady circle: closed form.
The disk leans by b towards the middle of the circle; it spins about its normal and the whole turns
about the vertical at -(r / R) spin, so that the contact does not slip. The contact force follows
from the acceleration of the centre; Euler's equation about it fixes the spin.
`simulated` integrates the disk in the generic simulator `kkt`."""

import numpy as np
from kkt import Body, System
from kkt_joints import disk
from rigid import GRAVITY, Array, Z, cross, product, rotation, turn

RADIUS, MASS, CIRCLE, LEAN = 0.05, 0.3048, 0.5, np.radians(5.0)
JP = tuple(x * MASS * RADIUS**2 for x in (0.25, 0.5, 0.25))
RATIO = RADIUS / CIRCLE
SPIN = np.sqrt(
    4 * GRAVITY / RADIUS * np.sin(LEAN)
    / ((6 - 5 * RATIO * np.sin(LEAN)) * RATIO * np.cos(LEAN))
)  # fmt: skip
HEADING = -RATIO * SPIN
PERIOD = -2 * np.pi / HEADING
Y = np.array([0.0, 1.0, 0.0])
AWAY, HEIGHT = CIRCLE - RADIUS * np.sin(LEAN), RADIUS * np.cos(LEAN)
P0 = product(turn(Y, -LEAN), turn(Z, -np.pi / 2))  # eta = (cos b, 0, sin b)


def motion(t: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot)."""
    out = np.array([np.cos(HEADING * t), np.sin(HEADING * t), 0.0])
    p = product(turn(Z, HEADING * t), product(P0, turn(Y, SPIN * t)))
    w = HEADING * Z + SPIN * (rotation(p) @ Y)
    v = HEADING * AWAY * cross(Z, out)
    rates = np.concatenate([v, w])
    return AWAY * out + HEIGHT * Z, p, rates, np.concatenate([cross(HEADING * Z, v),
                                                              cross(HEADING * Z, w)])  # fmt: skip


def system() -> System:
    """Return the disk on the ground, at the start."""
    r, p, v, _ = motion(0.0)
    start = (tuple(map(float, x)) for x in (r, p, v[:3], v[3:]))
    return System([Body("disk", MASS, JP, *start)], [disk("contact", 0, RADIUS, "xyz")])


SYSTEM = system()


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    r, p, v, v_dot = motion(t)
    out = SYSTEM.quantities(np.array([r]), np.array([p]), v, v_dot)
    return SYSTEM.counts | out | {"lambda.contact": MASS * (v_dot[:3] + GRAVITY * Z)}


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator()
