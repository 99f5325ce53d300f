"""Belt without stretch over two or more pulleys."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Joint,
    Vector,
    choice,
    hookimpl,
    joint_fields,
    numbers,
    points,
    vector,
)
from dap3d_core.kernels import add, by_body, cross, dot, neg, norm2, row, scale, sqrt, sub

interface_version = 1


class Belt(Joint):
    """A massless belt over pulleys, without slip and stretch: it couples their speeds.

    The ``points`` are the centres of the pulleys, in the order in which the belt runs around them
    counterclockwise, seen against ``axis_i``, and closes on the first. A negative radius is that of
    a pulley outside of the loop, on the back of the belt, which turns in the other direction. Span
    k runs from pulley k to the next. With rho_k the radii, d between the centres, l its length
    normal to the axis, u its direction there and m = axis x u, it touches both in the direction n:

        sin b = (rho_k - rho_(k+1)) / l,  n = sin b u - cos b m
        P_k = r_k + rho_k n,  P_(k+1) = r_(k+1) + rho_(k+1) n,  e along P_(k+1) - P_k
        J v   = e . (v_P_k - v_P_(k+1)) = 0,  k = 1 ... n - 1
        gamma = e_dot . (v_P_(k+1) - v_P_k) + e . (w_(k+1) x P_(k+1)_dot - w_k x P_k_dot)

    v_P is the velocity of the point of the pulley where the belt touches it, P_dot the rate of the
    arm from the mass centre to where it touches. The rows are those of all spans but the last, from
    pulley n back to the first; on fixed axes they imply its own, rho_k (w_k . axis) is the same for
    all pulleys. The multiplier of row k is the tension of span k, a force along it on both pulleys
    that loads their bearings; it is that above the tension of the last span, which is slack: begin
    the list behind the pulley that drives, so that the belt leaves it by this span. A run in which
    a span would have to push says so. There is no pretension; the force ``belt`` has one, and takes
    centres that move towards each other. With ``crossed`` the belt of two pulleys crosses itself,
    as with a negative second radius.
    """

    keyword, rows, holonomic = "belt", "n - 1", False
    synonyms = ("timing-belt", "chain")
    unilateral = True
    unilateral_words = (
        "this span would have to push: the last span, which closes the belt, is the slack one; "
        "begin the list of pulleys behind the one that drives, or take a force belt, with k"
    )
    example: ClassVar[Mapping[str, str]] = {"radii": "[0.1, 0.3]"}
    joints: tuple = joint_fields(points="P", axis_i="a", doc="hinges of the pulleys, in order")
    points: tuple = points(
        "n", least=2, apart=True, doc="centres of the pulleys, in order along the belt"
    )
    radii: tuple = numbers("n", unit="m", doc="radii; negative of a pulley on the belt's back")
    axis_i: Vector = vector(doc="direction of the axes of all pulleys, on any body")
    crossed: bool = choice((False, True), False, doc="the belt of two pulleys crosses itself")

    def prepare(self, bodies):
        return {"rho": signed_radii(self, bodies)}

    def C_dot(r_points, v_points, w_points, rho, axis_i, n):
        spans = runs(r_points, rho, axis_i)[: n - 1]
        return tuple(-rate for rate in speeds(spans, v_points, w_points, rho))

    def J(r_points, s_points, on_points, body_count, rho, axis_i, n):
        rows = []
        for a, b, e, _, moment in runs(r_points, rho, axis_i)[: n - 1]:
            of_a = row(e, add(cross(s_points[a], e), scale(rho[a], moment)))
            of_b = row(neg(e), neg(add(cross(s_points[b], e), scale(rho[b], moment))))
            rows.append(by_body((on_points[a], on_points[b]), ((of_a,), (of_b,)), body_count))
        return tuple(tuple(of_row[body][0] for of_row in rows) for body in range(body_count))

    def gamma(r_points, v_points, s_points_dot, w_points, rho, axis_i, axis_i_dot, n):
        found = []
        for a, b, e, m, _ in runs(r_points, rho, axis_i)[: n - 1]:
            d, d_dot = sub(r_points[b], r_points[a]), sub(v_points[b], v_points[a])
            less = rho[b] - rho[a]
            m_dot = contact_rate(d, d_dot, axis_i, axis_i_dot, -less)
            q, q_dot = add(d, scale(less, m)), add(d_dot, scale(less, m_dot))
            e_dot = scale(1.0 / sqrt(norm2(q)), sub(q_dot, scale(dot(e, q_dot), e)))
            w_a, w_b = scale(rho[a], w_points[a]), scale(rho[b], w_points[b])
            v = add(d_dot, cross(sub(w_b, w_a), m))
            on_a = cross(w_points[a], add(s_points_dot[a], scale(rho[a], m_dot)))
            on_b = cross(w_points[b], add(s_points_dot[b], scale(rho[b], m_dot)))
            found.append(dot(e_dot, v) + dot(e, sub(on_b, on_a)))
        return tuple(found)


def signed_radii(belt, bodies):
    """Radii of the pulleys of a belt, negative on its back.

    Raises:
        ValueError: they leave no room for a belt between two pulleys.
    """
    rho = list(belt.radii)
    if belt.crossed and len(rho) > 2:
        raise ValueError("crossed is for two pulleys; of more, give some a negative radius")
    if belt.crossed:
        rho[1] = -rho[1]
    places = [pose.place(P) for P, pose in zip(belt.points, bodies["points"], strict=True)]
    axis = bodies["i"].to_global(belt.axis_i)
    for k, place in enumerate(places):
        after = (k + 1) % len(places)
        if norm2(across(sub(places[after], place), axis)) <= (rho[k] - rho[after]) ** 2:
            raise ValueError(
                f"pulleys {k + 1} and {after + 1} are too near for a belt between them; "
                "give smaller radii or other points"
            )
    return tuple(rho)


def across(d, axis):
    """The part of a vector that is normal to the axis."""
    return sub(d, scale(dot(d, axis), axis))


def runs(r, rho, axis):
    """Of each span: its pulleys, its direction e, n towards where it touches them, and n x e."""
    spans, count = [], len(r)
    for a in range(count):
        b = (a + 1) % count
        if count > 2 or a == 0:
            d, difference = sub(r[b], r[a]), rho[a] - rho[b]
            along = dot(d, axis)
            flat = sub(d, scale(along, axis))
            square, less = norm2(flat), difference * difference
            free = square - less
            part, length = 1.0 / square, 1.0 / sqrt(free + along * along)
            out = scale(part * difference, flat)
            side = scale(part * sqrt(free), cross(axis, flat))
        else:  # the way back between two pulleys
            d, difference, side = neg(d), -difference, neg(side)
        n = sub(out, side)
        e = scale(length, sub(d, scale(difference, n)))
        spans.append((a, b, e, n, cross(n, e)))
    return spans


def contact_rate(d, d_dot, axis, axis_dot, difference):
    """The rate of the direction in which a span touches its pulleys, of radii of a difference."""
    along = dot(d, axis)
    flat = sub(d, scale(along, axis))
    along_dot = dot(d_dot, axis) + dot(d, axis_dot)
    flat_dot = sub(d_dot, add(scale(along_dot, axis), scale(along, axis_dot)))
    l = sqrt(norm2(flat))
    u = scale(1.0 / l, flat)
    l_dot = dot(u, flat_dot)
    u_dot = scale(1.0 / l, sub(flat_dot, scale(l_dot, u)))
    m, m_dot = cross(axis, u), add(cross(axis_dot, u), cross(axis, u_dot))
    s = difference / l
    z = sqrt(1.0 - s * s)
    s_dot = -s * l_dot / l
    turned = add(scale(s_dot, u), scale(s, u_dot))
    return sub(turned, sub(scale(z, m_dot), scale(s * s_dot / z, m)))


def speeds(spans, v, w, rho):
    """The rates at which spans become longer, m/s."""
    turning = [scale(rho_k, w_k) for rho_k, w_k in zip(rho, w, strict=True)]
    return tuple(
        dot(e, sub(v[b], v[a])) + dot(moment, sub(turning[b], turning[a]))
        for a, b, e, _, moment in spans
    )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Belt]
