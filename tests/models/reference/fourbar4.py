"""Reference for the model `fourbar4`: that of `fourbar3` with its ground link as a fourth body.
The link stays at rest, so the motion is that of `fourbar`, in closed form; the reactions are those
that Newton's law needs for it (23 unknowns, 24 equations). `simulated` integrates the same system
with the generic simulator `kkt`."""

import fourbar
import fourbar3
import numpy as np
from kkt import Body, Driver, Fixed, Spring, System, rev, sph
from kkt_joints import fix
from rigid import Array

CRANK, COUPLER, FOLLOWER, LINK = 0, 1, 2, 3
PLACE = (0.0, 2.0, 0.0)
P7, P8 = Fixed(LINK, (0.0, 2.0, 0.0)), Fixed(LINK, (0.0, -2.0, 0.0))
AXIS_X, AXIS_H = Fixed(LINK, fourbar3.AXIS_X), Fixed(LINK, fourbar3.AXIS_H)

SYSTEM = System(
    bodies=[*fourbar3.SYSTEM.bodies, Body("link", 1.0, (1.4, 0.1, 1.4), PLACE)],
    joints=[
        rev("J1", fourbar3.P1, P8, Fixed(CRANK, fourbar3.AXIS_X), AXIS_X),
        sph("J2", fourbar3.P2, fourbar3.P3),
        sph("J3", fourbar3.P4, fourbar3.P5),
        rev("J4", fourbar3.P6, P7, Fixed(FOLLOWER, fourbar3.AXIS_H), AXIS_H),
        fix("J6", LINK, PLACE),
    ],
    driver=Driver("J5", CRANK, AXIS_X, fourbar.RATE),
    springs=[Spring(fourbar3.P4, P8, k=fourbar.SPRING_K, length=fourbar.SPRING_LENGTH)],
    weight=False,
)


def link(_: float) -> tuple[Array, Array, Array, Array]:
    """Return r, p, (v, w) and (v_dot, w_dot) of the ground link."""
    return np.array(PLACE), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(6), np.zeros(6)


PARTS = (fourbar.crank, fourbar.coupler, fourbar.follower, link)


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    r, p, v, v_dot = (np.array(x) for x in zip(*(part(t) for part in PARTS), strict=True))
    return SYSTEM.counts | SYSTEM.quantities(r, p, v.ravel(), v_dot.ravel())


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator()
