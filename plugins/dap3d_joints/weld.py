"""Weld: two bodies keep the pose to each other that they were given."""

from dap3d_core.interface import Body, Joint, body, hookimpl
from dap3d_core.kernels import (
    add,
    conjugate,
    cross,
    eye,
    hstack,
    neg,
    quaternion_product,
    scale,
    skew,
    sub,
)
from dap3d_joints.orientation import error, error_rate, turn

interface_version = 1


class Weld(Joint):
    """Bodies i and j keep the relative pose of the scene; nothing is left free between them.

    ``fix`` for two bodies, in position and orientation; with d_j the vector from the mass centre of
    j to that of i, fixed in j, and the error quaternion q = p_i o conj(p_c) o conj(p_j) = (q0, e),
    q0 >= 0, p_c = conj(p_j) o p_i in the scene, rows 1 to 3 and 4 to 6:

        C     = r_i - r_j - d_j             C     = 2 e
        J_i   = [I, 0],  J_j = [-I, d_j~]   J_i   = [0, q0 I - e~],  J_j = [0, -(q0 I + e~)]
        gamma = w_j x (w_j x d_j)           gamma = -q0_dot (w_i - w_j) + e_dot x (w_i + w_j)

    The reaction is what the weld carries. Two bodies whose joint is of no interest are better one
    body: six rows and seven coordinates less.
    """

    keyword, rows = "weld", 6
    body_axes = ()  # the pose to each other alone
    synonyms = ("fixed", "rigid", "lock")
    symbol = "block"
    body_i: Body = body(doc="one of the bodies")
    body_j: Body = body(doc="the other one; ground may be it")

    def prepare(self, bodies):
        one, other = bodies["i"], bodies["j"]
        return {
            "d_j": other.to_local(sub(one.r, other.r)),
            "p_c": quaternion_product(conjugate(other.p), one.p),
        }

    def C(r_i, r_j, p_i, p_j, d_j, p_c):
        _, e = error(p_i, p_c, p_j)
        return (*sub(sub(r_i, r_j), d_j), *scale(2.0, e))

    def J(p_i, p_j, d_j, p_c):
        q0, e = error(p_i, p_c, p_j)
        minus = tuple(neg(r) for r in turn(q0, neg(e)))
        return (
            hstack(eye(1.0), eye(0.0)) + hstack(eye(0.0), turn(q0, e)),
            hstack(eye(-1.0), skew(d_j)) + hstack(eye(0.0), minus),
        )

    def gamma(p_i, p_j, d_j, p_c, w_i, w_j):
        q0, e = error(p_i, p_c, p_j)
        q0_dot, e_dot = error_rate(q0, e, w_j, w_i)
        turning = add(scale(-q0_dot, sub(w_i, w_j)), cross(e_dot, add(w_i, w_j)))
        return (*cross(w_j, cross(w_j, d_j)), *turning)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Weld]
