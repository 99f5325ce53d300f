"""Follower: one body moves against another as a third body turns."""

from dap3d_core.interface import Body, Joint, Vector, body, choice, hookimpl, number, vector
from dap3d_core.kernels import cross, dot, neg, row, scale, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Follower(Joint):
    """The rate of body i against body j about a_j is ``ratio`` times that of body k about a_k.

    It transmits moments about the axes, or along a_j a force, and no force of teeth, belt or rack
    between wheel and body: the bearings of both carry what else acts on them, and nothing of it.

    One row, of the velocity level alone, as those of ``rel-rot`` and ``rel-tran``. Body k, a wheel,
    turns against ground:

        J v   = a_j . (w_i - w_j) - ratio a_k . w_k = 0
        gamma = ratio a_k_dot . w_k - a_j_dot . (w_i - w_j)

    With ``along`` the rate is that of the mass centre of body i along a_j, as seen from body j,
    with d = r_i - r_j: a_j . (v_i - v_j - w_j x d).

    A wheel of inertia I on a bearing of its own adds I ratio^2 to the inertia of a joint, and to
    nothing else, as the rotor of a motor behind a gear does. Two followers of one wheel couple
    two joints.
    """

    keyword, rows, holonomic = "follow", 1, False
    symbol = "ring"
    body_i: Body = body(doc="the body that follows")
    a_j: Vector = vector(doc="axis, on the body that body i moves against")
    a_k: Vector = vector(doc="axis of the wheel, on the wheel")
    ratio: float = number(default=1.0, doc="rate of body i, rad/s or m/s, for 1 rad/s of the wheel")
    along: bool = choice((False, True), default=False, doc="body i slides, and does not turn")

    def J(a_j, a_k, ratio):
        return row(ZERO, a_j), row(ZERO, neg(a_j)), row(ZERO, scale(-ratio, a_k))

    def gamma(a_j_dot, a_k_dot, w_i, w_j, w_k, ratio):
        return ratio * dot(a_k_dot, w_k) - dot(a_j_dot, sub(w_i, w_j))


class Sliding(Follower, along=True):
    """Body i slides along the axis."""

    def J(a_j, a_k, ratio, r_i, r_j):
        arm = cross(sub(r_i, r_j), a_j)
        return row(a_j, ZERO), row(neg(a_j), neg(arm)), row(ZERO, scale(-ratio, a_k))

    def gamma(a_j, a_j_dot, a_k_dot, r_i, r_j, v_i, v_j, w_j, w_k, ratio):
        d, d_dot = sub(r_i, r_j), sub(v_i, v_j)
        slide = dot(a_j_dot, sub(d_dot, cross(w_j, d))) - dot(a_j, cross(w_j, d_dot))
        return ratio * dot(a_k_dot, w_k) - slide


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Follower]
