"""Fixed body: keeps the pose it was given."""

from dap3d_core.interface import Body, Joint, body, hookimpl
from dap3d_core.kernels import add, cross, eye, hstack, scale, sub
from dap3d_joints.orientation import error, error_rate, turn

interface_version = 1

ZERO = (0.0, 0.0, 0.0)
IDENTITY = (1.0, 0.0, 0.0, 0.0)


class Fixed(Joint):
    """Body i keeps the position r0 and the orientation p0 of the scene; nothing is left free.

    Manual: ``fix``, there at velocity level alone, so that the correction of the initial positions
    moves the body. With q = p o conj(p0) = (q0, e), q0 >= 0, rows 1 to 3 and 4 to 6:

        C     = r - r0         C     = 2 e
        J_i   = [I, 0]         J_i   = [0, q0 I - e~]
        gamma = 0              gamma = -q0_dot w + e_dot x w
    """

    keyword, rows = "fix", 6
    symbol = "block"
    body_i: Body = body(doc="the body that is fixed")

    def prepare(self, bodies):
        return {"position": bodies["i"].r, "orientation": bodies["i"].p}

    def C(r_i, p_i, position, orientation):
        _, e = error(p_i, IDENTITY, orientation)
        return (*sub(r_i, position), *scale(2.0, e))

    def J(p_i, orientation):
        q0, e = error(p_i, IDENTITY, orientation)
        return (hstack(eye(1.0), eye(0.0)) + hstack(eye(0.0), turn(q0, e)),)

    def gamma(p_i, orientation, w_i):
        q0, e = error(p_i, IDENTITY, orientation)
        q0_dot, e_dot = error_rate(q0, e, ZERO, w_i)
        return (*ZERO, *add(scale(-q0_dot, w_i), cross(e_dot, w_i)))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Fixed]
