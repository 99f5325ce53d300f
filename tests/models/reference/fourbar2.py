"""Reference for the model `fourbar2`: crank and follower as bodies, the coupler a massless link.
The motion is that of `fourbar3`; the reactions are those that Newton's law needs for it (12
unknowns, 12 equations). `simulated` integrates the same system with the generic simulator `kkt`."""

import fourbar
import numpy as np
from kkt import GROUND, Body, Driver, Fixed, Spring, System, distance, rev
from rigid import Array

CRANK, FOLLOWER = 0, 1
AXIS_X, AXIS_H = (1.0, 0.0, 0.0), tuple(fourbar.H)
P1, P2 = Fixed(CRANK, (0.0, 0.0, -1.0)), Fixed(CRANK, (0.0, 0.0, 1.0))
P3, P4 = Fixed(FOLLOWER, (0.0, 0.0, 3.5)), Fixed(FOLLOWER, (0.0, 0.0, -3.5))
P5, P6 = Fixed(GROUND, (0.0, 4.0, 0.0)), Fixed(GROUND, (0.0, 0.0, 0.0))

SYSTEM = System(
    bodies=[
        Body("crank", 1.0, (0.5, 0.5, 0.1), (0.0, 0.0, 1.0)),
        Body(
            "follower",
            3.0,
            (12.0, 12.0, 0.3),
            (0.0025008934957, 3.9974991065043, 3.49999821300861),
            (0.99999987235775, 0.00035727054499, 0.00035727054499, 0.0),
        ),
    ],
    joints=[
        rev("J1", P1, P6, Fixed(CRANK, AXIS_X), Fixed(GROUND, AXIS_X)),
        distance("J2", P2, P3, fourbar.COUPLER),
        rev("J3", P4, P5, Fixed(FOLLOWER, AXIS_H), Fixed(GROUND, AXIS_H)),
    ],
    driver=Driver("J4", CRANK, Fixed(GROUND, AXIS_X), fourbar.RATE),
    springs=[Spring(P3, P6, k=fourbar.SPRING_K, length=fourbar.SPRING_LENGTH)],
    weight=False,
)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    parts = [body(t) for body in (fourbar.crank, fourbar.follower)]
    r, p, v, v_dot = (np.array(x) for x in zip(*parts, strict=True))
    return SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator()
