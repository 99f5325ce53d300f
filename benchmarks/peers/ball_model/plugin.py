"""The contact of a ball with the ground that every program is given in Python."""

from dap3d_core.interface import Body, Force, body, hookimpl, number
from dap3d_core.kernels import where

interface_version = 1


class SpringyGround(Force):
    """f_z = max(0, k (R - z) - c z_dot) where z < R, else 0."""

    keyword = "springy-ground"
    body_i: Body = body(doc="the ball")
    R: float = number(default=0.1, unit="m", positive=True, doc="radius")
    k: float = number(default=2000.0, unit="N/m", minimum=0.0, doc="stiffness")
    c: float = number(default=5.0, unit="N s/m", minimum=0.0, doc="damping coefficient")

    def wrench(r_i, v_i, R, k, c):
        depth = R - r_i[2]
        push = k * depth - c * v_i[2]
        fz = where(depth > 0.0, where(push > 0.0, push, 0.0), 0.0)
        return (((0.0, 0.0, fz), (0.0, 0.0, 0.0)),)


@hookimpl
def dap3d_forces():
    """Return the force types of this file."""
    return [SpringyGround]
