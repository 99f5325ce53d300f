"""The contact of a ball with the ground: the `user_force` of the manual's model Ball1."""

from dap3d_core.interface import Body, Force, body, hookimpl, number
from dap3d_core.kernels import where

interface_version = 1


class BallContact(Force):
    """A spring and a damper in z that act while the ball touches the ground z = 0.

        delta = z - R,  f_z = -k delta - c z_dot where delta < 0, else 0
        energy = k delta^2 / 2 in contact

    There is no moment: the force passes through the mass centre. Just before the ball leaves the
    ground the damper is stronger than the spring and the force pulls; so it does in the manual.
    """

    keyword = "ball-contact"
    body_i: Body = body(doc="the ball, its centre at the origin of the body")
    R: float = number(default=0.1, unit="m", positive=True, doc="radius")
    k: float = number(default=2000.0, unit="N/m", minimum=0.0, doc="stiffness")
    c: float = number(default=5.0, unit="N s/m", minimum=0.0, doc="damping coefficient")

    def wrench(r_i, v_i, R, k, c):
        delta = r_i[2] - R
        fz = where(delta < 0.0, -k * delta - c * v_i[2], 0.0)
        return (((0.0, 0.0, fz), (0.0, 0.0, 0.0)),)  # one body, so one pair (force, moment)

    def energy(r_i, R, k):
        delta = r_i[2] - R
        return where(delta < 0.0, 0.5 * k * delta * delta, 0.0)

    def switch(r_i, R):
        return r_i[2] - R  # where it changes its sign the force jumps: no step goes across


@hookimpl
def dap3d_forces():
    """Return the force types of this file."""
    return [BallContact]
