"""Reference for the model `fourbar4`: that of `fourbar3` with its ground link as a fourth body.
The link stays at rest, so the motion is that of `fourbar`, in closed form; the reactions are those
that Newton's law needs for it (23 unknowns, 24 equations, residual checked). What the fixing joint
carries is found once more in `held` from the balance of the whole mechanism, without any Jacobian.
`simulated` integrates the same system with the generic simulator `kkt`."""

import fourbar
import fourbar3
import numpy as np
from kkt import Body, Driver, Fixed, Spring, System, rev, sph
from kkt_joints import fix
from rigid import Array, cross

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


def driver_moment(t: float) -> float:
    """Return the moment of the driver on the crank about x [N m] from the power balance."""
    return fourbar.driver_moment(t, [(b.mass, b.Jp) for b in SYSTEM.bodies], PARTS)


def held(t: float) -> Array:
    """Return what the fixing joint exerts on the link: force, moment about its mass centre.
    Nothing else acts from outside, so it is the rate of the momentum of the moving bodies."""
    force, moment = np.zeros(3), np.zeros(3)
    for body, part in zip(SYSTEM.bodies, PARTS, strict=True):
        r, p, v, v_dot = part(t)
        A = fourbar.rotation(p)
        J = A @ np.diag(body.Jp) @ A.T
        force += body.mass * v_dot[:3]
        moment += cross(r - np.array(PLACE), body.mass * v_dot[:3])
        moment += J @ v_dot[3:] + cross(v[3:], J @ v[3:])
    return np.concatenate([force, moment])


#: The quantities once more, from the generic simulator.
simulated = SYSTEM.simulator()
