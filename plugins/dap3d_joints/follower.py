"""Follower: one body moves against another as a third body turns."""

from dap3d_core.interface import (
    Body,
    Joint,
    Vector,
    body,
    choice,
    hookimpl,
    number,
    numbers,
    vector,
)
from dap3d_core.kernels import cross, dot, neg, normals, row, scale, sub
from dap3d_joints.turning import line_rates, turned_by

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
    with d = r_i - r_j: a_j . (v_i - v_j - w_j x d). With ``curved`` the ratio changes with the
    angle theta of the wheel, in (-pi, pi] and 0 at the start, so that body i moves as a polynomial:

        ratio + bends_1 theta + bends_2 theta^2 + bends_3 theta^3

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
    curved: bool = choice((False, True), default=False, doc="bends hold: the ratio changes")
    bends: tuple = numbers(3, (0.0, 0.0, 0.0), doc="of the ratio with the angle of the wheel")

    def J(a_j, a_k, ratio):
        return turning(a_j, a_k, ratio)

    def gamma(a_j_dot, a_k_dot, w_i, w_j, w_k, ratio):
        return ratio * dot(a_k_dot, w_k) - dot(a_j_dot, sub(w_i, w_j))


class Curved(Follower, curved=True, along=False):
    """The ratio changes."""

    ground_axes = True  # that the wheel turns against

    def prepare(self, bodies):
        n, m = normals(self.a_k)
        return {"n_k": n, "m_k": m, "zero": bodies["k"].to_global(n)}

    def J(a_j, a_k, n_k, m_k, zero, ratio, bends):
        return turning(a_j, a_k, ratio_at(n_k, m_k, zero, ratio, bends))

    def gamma(a_j_dot, a_k, a_k_dot, n_k, m_k, zero, w_i, w_j, w_k, ratio, bends):
        of_wheel = curved_gamma(a_k, a_k_dot, n_k, m_k, zero, w_k, ratio, bends)
        return of_wheel - dot(a_j_dot, sub(w_i, w_j))


class CurvedSliding(Curved, curved=True, along=True):
    """The ratio changes, and body i slides."""

    def J(a_j, a_k, n_k, m_k, zero, ratio, bends, r_i, r_j):
        return sliding(a_j, a_k, ratio_at(n_k, m_k, zero, ratio, bends), r_i, r_j)

    def gamma(a_j, a_j_dot, a_k, a_k_dot, n_k, m_k, zero, r_i, r_j, v_i, v_j, w_j, w_k, ratio,
              bends):  # fmt: skip
        of_wheel = curved_gamma(a_k, a_k_dot, n_k, m_k, zero, w_k, ratio, bends)
        return of_wheel - sliding_gamma(a_j, a_j_dot, r_i, r_j, v_i, v_j, w_j)


class Sliding(Follower, along=True):
    """Body i slides along the axis."""

    def J(a_j, a_k, ratio, r_i, r_j):
        return sliding(a_j, a_k, ratio, r_i, r_j)

    def gamma(a_j, a_j_dot, a_k_dot, r_i, r_j, v_i, v_j, w_j, w_k, ratio):
        slide = sliding_gamma(a_j, a_j_dot, r_i, r_j, v_i, v_j, w_j)
        return ratio * dot(a_k_dot, w_k) - slide


def turning(a_j, a_k, ratio):
    """The row of bodies that turn."""
    return row(ZERO, a_j), row(ZERO, neg(a_j)), row(ZERO, scale(-ratio, a_k))


def sliding(a_j, a_k, ratio, r_i, r_j):
    """The row of a body that slides."""
    arm = cross(sub(r_i, r_j), a_j)
    return row(a_j, ZERO), row(neg(a_j), neg(arm)), row(ZERO, scale(-ratio, a_k))


def ratio_at(n, m, zero, ratio, bends):
    """The ratio at the angle of the wheel."""
    angle, (a, b, c) = turned_by(n, m, zero), bends
    return ratio + angle * (a + angle * (b + angle * c))


def curved_gamma(a_k, a_k_dot, n, m, zero, w_k, ratio, bends):
    """What the part of the wheel gains but by its acceleration."""
    angle, (a, b, c) = turned_by(n, m, zero), bends
    slope = a + angle * (2.0 * b + angle * (3.0 * c))
    now, angle_dot = ratio_at(n, m, zero, ratio, bends), dot(line_rates(zero, a_k)[1], w_k)
    return now * dot(a_k_dot, w_k) + slope * angle_dot * dot(a_k, w_k)


def sliding_gamma(a_j, a_j_dot, r_i, r_j, v_i, v_j, w_j):
    """What the rate along a_j gains but by accelerations of the bodies."""
    d, d_dot = sub(r_i, r_j), sub(v_i, v_j)
    return dot(a_j_dot, sub(d_dot, cross(w_j, d))) - dot(a_j, cross(w_j, d_dot))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Follower]
