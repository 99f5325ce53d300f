"""Reference for the model `fourbar3`: crank, coupler and follower as bodies.
Positions, velocities and accelerations come in closed form (`fourbar`); the reactions are those
that Newton's law needs for these accelerations (17 unknowns, 18 equations). `simulated` integrates
the same system with the generic simulator `kkt`."""

import fourbar
import numpy as np
from kkt import GROUND, Body, Driver, Fixed, Spring, System, rev, sph
from rigid import Array

CRANK, COUPLER, FOLLOWER = 0, 1, 2
AXIS_X, AXIS_H = (1.0, 0.0, 0.0), tuple(fourbar.H)
P1, P2 = Fixed(CRANK, (0.0, 0.0, -1.0)), Fixed(CRANK, (0.0, 0.0, 1.0))
P3, P4 = Fixed(COUPLER, (0.0, 0.0, -3.2)), Fixed(COUPLER, (0.0, 0.0, 3.2))
P5, P6 = Fixed(FOLLOWER, (0.0, 0.0, 3.5)), Fixed(FOLLOWER, (0.0, 0.0, -3.5))
P7, P8 = Fixed(GROUND, (0.0, 4.0, 0.0)), Fixed(GROUND, (0.0, 0.0, 0.0))
FOLLOWER_P0 = (0.99999987235775, 0.00035727054499, 0.00035727054499, 0.0)


SYSTEM = System(
    bodies=[
        Body("crank", 1.0, (0.5, 0.5, 0.1), (0.0, 0.0, 1.0)),
        Body(
            "coupler",
            2.0,
            (7.0, 7.0, 0.2),
            (0.0025008934957, 1.9974991065043, 4.49999821300861),
            fourbar.COUPLER_P0,
        ),
        Body(
            "follower",
            3.0,
            (12.0, 12.0, 0.3),
            (0.0025008934957, 3.9974991065043, 3.49999821300861),
            FOLLOWER_P0,
        ),
    ],
    joints=[
        rev("J1", P1, P8, Fixed(CRANK, AXIS_X), Fixed(GROUND, AXIS_X)),
        sph("J2", P2, P3),
        sph("J3", P4, P5),
        rev("J4", P6, P7, Fixed(FOLLOWER, AXIS_H), Fixed(GROUND, AXIS_H)),
    ],
    driver=Driver("J5", CRANK, Fixed(GROUND, AXIS_X), fourbar.RATE),
    springs=[Spring(P4, P8, k=fourbar.SPRING_K, length=fourbar.SPRING_LENGTH)],
    weight=False,
)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    parts = [body(t) for body in (fourbar.crank, fourbar.coupler, fourbar.follower)]
    r, p, v, v_dot = (np.array(x) for x in zip(*parts, strict=True))
    return SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator()
