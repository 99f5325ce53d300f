"""Reference for the model `bicycle`: the benchmark of Meijaard, Papadopoulos, Ruina, Schwab (2007).
Four bodies, three hinges and two rolling disks in the generic simulator `kkt`. The paper has z
downward; here it is upward, which turns the sign of z and of the products of inertia."""

import numpy as np
from kkt import Body, Fixed, System, rev
from kkt_joints import disk
from rigid import Array

WHEELBASE, TRAIL, TILT = 1.02, 0.08, np.pi / 10
REAR, FRONT = 0.3, 0.35
SPEED, LEAN_RATE = 4.6, 0.5
FRAME, FORK = (0.3, 0.0, 0.9), (0.9, 0.0, 0.7)
UP = (-np.sin(TILT), 0.0, np.cos(TILT))  # of the steer axis
Y = (0.0, 1.0, 0.0)


def body(name: str, mass: float, Jp: tuple, r: tuple[float, float, float], spin: float) -> Body:
    """Return a body that goes ahead, leans about the line of the contacts and spins about y."""
    return Body(name, mass, Jp, r, v=(SPEED, -LEAN_RATE * r[2], 0.0), w=(LEAN_RATE, spin, 0.0))


def system() -> System:
    """Return the bicycle, upright."""
    bodies = [
        body("rear_wheel", 2.0, (0.0603, 0.12, 0.0603), (0.0, 0.0, REAR), SPEED / REAR),
        body("frame", 85.0, ((9.2, 0.0, -2.4), (0.0, 11.0, 0.0), (-2.4, 0.0, 2.8)), FRAME, 0.0),
        body("fork", 4.0, ((0.05892, 0.0, 0.00756), (0.0, 0.06, 0.0), (0.00756, 0.0, 0.00708)),
             FORK, 0.0),
        body("front_wheel", 3.0, (0.1405, 0.28, 0.1405), (WHEELBASE, 0.0, FRONT), SPEED / FRONT),
    ]  # fmt: skip
    head = np.array([WHEELBASE + TRAIL - np.tan(TILT) * FORK[2], 0.0, FORK[2]])
    on_frame, on_fork = (tuple(head - np.array(r)) for r in (FRAME, FORK))
    rear = tuple(np.array([0.0, 0.0, REAR]) - FRAME)
    front = tuple(np.array([WHEELBASE, 0.0, FRONT]) - FORK)
    centre = (0.0, 0.0, 0.0)
    joints = [
        rev("rear_axle", Fixed(0, centre), Fixed(1, rear), Fixed(0, Y), Fixed(1, Y)),
        rev("steering", Fixed(2, on_fork), Fixed(1, on_frame), Fixed(2, UP), Fixed(1, UP)),
        rev("front_axle", Fixed(3, centre), Fixed(2, front), Fixed(3, Y), Fixed(2, Y)),
        disk("rear_contact", 0, REAR, "xyz"),
        disk("front_contact", 3, FRONT, "xyz"),
    ]
    return System(bodies, joints)


SYSTEM = system()


SIMULATED = SYSTEM.simulator(1e-12, 1e-14)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    return SYSTEM.counts | SIMULATED(t)
