"""Shortest way of a cable from point to point over a sphere or a cylinder."""

from dap3d_core.kernels import (
    add,
    atan2,
    cos,
    cross,
    dot,
    minimum,
    root,
    scale,
    sin,
    sqrt,
    sub,
    where,
)

ZERO = (0.0, 0.0, 0.0)
PI = 3.141592653589793
#: Of the sine of an angle that two points are seen at, below which they define no plane.
STRAIGHT = 1e-14


def wrapped(A, B, centre, radius, axis, side, inside):
    """The way from A to B, which a sphere or cylinder may be in.

    Seen along the normal n of the plane of A, B and the centre, or along the axis of a cylinder, A
    and B are at distances l and an angle phi; they see the circle under acos(r / l) each, and the
    arc between the tangents is what is left of phi. Along the axis the way rises evenly, as a helix
    is straight on the developed cylinder.

    Args:
        A, B: points; where one lies in the solid the way is straight.
        centre, radius: of the solid.
        axis: direction of a cylinder; None for a sphere.
        side: the way does not pass the centre opposite to it; None for the shorter.
        inside: the way comes through the circle, at a point where it is shortest, from outside.

    Returns:
        length; directions of the way from A and to B; arms from the centre to the points where it
        meets the solid and leaves it; a number that is positive where it touches; one that changes
        its sign where it changes sides, None where that is at points alone.
    """
    a, b, rise = sub(A, centre), sub(B, centre), 0.0
    if axis is not None:
        low = dot(axis, a)
        rise = dot(axis, b) - low
        a, b = sub(a, scale(low, axis)), sub(b, scale(low + rise, axis))
    n, phi, sides = _plane(a, b, axis)
    aa, bb, rr = dot(a, a), dot(b, b), radius * radius
    free = minimum(aa, bb) - rr
    l_a, l_b = (sqrt(where(free > 0.0, x, 4.0 * rr)) for x in (aa, bb))
    t_a, t_b = (sqrt(where(free > 0.0, x - rr, rr)) for x in (aa, bb))
    e_a, e_b = scale(1.0 / l_a, a), scale(1.0 / l_b, b)
    arc = phi - atan2(t_a, radius) - atan2(t_b, radius)
    if inside:
        psi, on, touches = _nearest(l_a, l_b, radius, phi), 0.0, -arc
        P = Q = add(scale(radius * cos(psi), e_a), scale(radius * sin(psi), cross(n, e_a)))
        (s_a, on_a), (s_b, on_b) = length_of(sub(P, a)), length_of(sub(b, Q))
    else:
        way, s_a, s_b = 1.0, t_a, t_b
        if side is not None:
            s = sub(side, centre)
            opposite = minimum(dot(n, cross(s, a)), dot(n, cross(b, s)))  # between a and b
            way, sides = where(opposite > 0.0, -1.0, 1.0), opposite
            arc = where(opposite > 0.0, arc + 2.0 * (PI - phi), arc)
        P, Q = _tangents(e_a, e_b, n, (l_a, l_b, t_a, t_b), radius, way)
        on_a, on_b = (scale(way / radius, cross(n, p)) for p in (P, Q))
        touches, on = arc, radius * arc
    length = flat = s_a + on + s_b
    if axis is not None:
        length = sqrt(flat * flat + rise * rise)
        on_a, on_b = (
            add(scale(flat / length, e), scale(rise / length, axis)) for e in (on_a, on_b)
        )
        P = add(P, scale(low + rise * s_a / flat, axis))
        Q = add(Q, scale(low + rise * (s_a + on) / flat, axis))
    touches = minimum(touches, free)
    (straight, u), on = length_of(sub(B, A)), touches > 0.0
    on_a, on_b = (tuple(map(where, (on,) * 3, e, u)) for e in (on_a, on_b))
    length = where(on, length, straight)
    return length, on_a, on_b, P, Q, touches, None if inside else sides


def length_of(d):
    """The length of a vector, and its direction."""
    length = sqrt(dot(d, d))
    return length, scale(1.0 / length, d)


def _plane(a, b, axis):
    """The direction about which a turns to b the short way, the angle, and the sense about axis."""
    c, along = cross(a, b), dot(a, b)
    if axis is not None:
        c = dot(axis, c)
        turn = where(c < 0.0, -1.0, 1.0)
        return scale(turn, axis), atan2(turn * c, along), c
    square, x = dot(c, c), a[0] * a[0]
    other = tuple(
        where(3.0 * x < dot(a, a), *pair) for pair in ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    )
    line = square <= STRAIGHT * STRAIGHT * dot(a, a) * dot(b, b)
    c_0 = cross(a, other)
    size = sqrt(where(line, 1.0, square))
    normal = tuple(where(line, y, x) for x, y in zip(c, c_0, strict=True))
    return (
        scale(1.0 / sqrt(dot(normal, normal)), normal),
        atan2(where(line, 0.0, size), along),
        None,
    )


def _tangents(e_a, e_b, n, lengths, radius, way):
    """Where the tangents from A and B meet the circle, the short way round (1) or the other."""
    l_a, l_b, t_a, t_b = lengths
    along, across = radius * radius, way * radius
    P = add(scale(along / l_a, e_a), scale(across * t_a / l_a, cross(n, e_a)))
    return P, sub(scale(along / l_b, e_b), scale(across * t_b / l_b, cross(n, e_b)))


def _nearest(l_a, l_b, r, phi):
    """The angle from A at which the way over a point of the circle is shortest."""

    def slope(psi):
        D_a = sqrt(l_a * l_a + r * r - 2.0 * l_a * r * cos(psi))
        D_b = sqrt(l_b * l_b + r * r - 2.0 * l_b * r * cos(phi - psi))
        s_a, s_b = l_a * r * sin(psi), l_b * r * sin(phi - psi)
        bend_a = l_a * r * cos(psi) / D_a - s_a * s_a / (D_a * D_a * D_a)
        bend_b = l_b * r * cos(phi - psi) / D_b - s_b * s_b / (D_b * D_b * D_b)
        return s_a / D_a - s_b / D_b, bend_a + bend_b

    w_a, w_b = l_a * (l_b - r), l_b * (l_a - r)
    (psi,), _ = root((phi * w_b / (w_a + w_b),), lambda x: (slope(x)[0],),
                     lambda x: ((slope(x)[1],),))  # fmt: skip
    return psi
