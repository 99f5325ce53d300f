"""Way of a cable from point to point, the shortest over spheres and cylinders between them."""

from dap3d_core.kernels.eliminate_unknowns import root
from dap3d_core.kernels.scalar_math import atan2, cos, minimum, sin, sqrt, where
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub

ZERO = (0.0, 0.0, 0.0)
PI = 3.141592653589793
#: How a cable passes a drum: not opposite to a point, or through it.
PAST_SIDE, INSIDE = 1.0, 2.0
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


def cable_spans(r, drums, radii, axes, sides, after, ways, divisors):
    """Of each span: its first point, its share in the length, its drum or None, and its way."""
    found = []
    for k in range(len(r) - 1):
        drum = after.index(k + 1.0) if k + 1.0 in after else None
        if divisors[k] == 0.0:
            continue
        if drum is None:
            l, u = length_of(sub(r[k + 1], r[k]))
            way = (l, u, u)
        else:
            axis = axes[drum] if drum < len(axes) else None
            side = sides[drum] if sides and ways[drum] == PAST_SIDE else None
            way = wrapped(r[k], r[k + 1], drums[drum], radii[drum], axis, side,
                          inside=ways[drum] == INSIDE)  # fmt: skip
        found.append((k, 1.0 / divisors[k], drum, way))
    return found


def cable_length(path):
    """The length L, m."""
    return sum(share * way[0] for _, share, _, way in path)


def cable_pulls(path):
    """The forces of a tension of 1: of each its point or drum, the arm from there, the force."""
    at_points, at_drums = [], []
    for k, share, drum, way in path:
        u, v = scale(share, way[1]), scale(-share, way[2])
        at_points += [(k, u), (k + 1, v)]
        if drum is not None:  # where it does not touch, the two forces are opposite
            touches = way[5] > 0.0
            P, Q = (tuple(where(touches, x, 0.0) for x in arm) for arm in way[3:5])
            at_drums += [(drum, P, scale(-1.0, u)), (drum, Q, scale(-1.0, v))]
    return at_points, at_drums


def cable_rate(path, v, v_drums, w_drums):
    """The rate of L, m/s: less the power of a tension of 1."""
    at_points, at_drums = cable_pulls(path)
    power = sum(dot(F, v[k]) for k, F in at_points)
    return -power - sum(dot(F, add(v_drums[b], cross(w_drums[b], arm))) for b, arm, F in at_drums)


def cable_bending(path, points, drums, axes, ways):
    """The second derivative of the length L in time, but for the accelerations of bodies, m/s^2.

    Args:
        path: of ``cable_spans``.
        points: positions, velocities, and w x s_dot, of each point, (n, 3) each.
        drums: the same of their centres, and angular velocities of their bodies.
        axes, ways: as of ``cable_spans``.
    """
    r, v, turning = points
    found = 0.0
    for k, share, drum, way in path:
        if drum is None:
            d, d_dot = sub(r[k + 1], r[k]), sub(v[k + 1], v[k])
            more = bent_straight(d, d_dot) + dot(way[1], sub(turning[k + 1], turning[k]))
        else:
            r_c, v_c, turning_c, w = (x[drum] for x in drums)
            ends = []
            for P in (k, k + 1):  # as seen from the drum, which turns
                arm = sub(r[P], r_c)
                arm_dot = sub(sub(v[P], v_c), cross(w, arm))
                bend = sub(turning[P], turning_c)
                twice = add(scale(2.0, arm_dot), cross(w, arm))
                ends.append((arm, arm_dot, sub(bend, cross(w, twice))))
            (a, a_dot, a_bend), (b, b_dot, b_bend) = ends
            axis = axes[drum] if drum < len(axes) else None
            more = bent(a, b, a_dot, b_dot, way, axis, inside=ways[drum] == INSIDE)
            more = more + dot(way[2], b_bend) - dot(way[1], a_bend)
        found = found + share * more
    return found


def bent_straight(d, d_dot):
    """The second derivative of |d| with its rate constant."""
    l, u = length_of(d)
    along = dot(u, d_dot)
    return (dot(d_dot, d_dot) - along * along) / l


def bent(a, b, a_dot, b_dot, way, axis, inside):
    """The second derivative of the length of a way past a drum, with constant rates of its ends.

    In the plane a tangent from A turns about the point where it touches; through a drum the point
    itself moves, to where the way stays shortest. Out of the plane of a sphere the plane turns,
    and the length depends on the distances of A and B and the angle between them alone.

    Args: ends, and their rates, as seen from the drum; the others as of ``wrapped``.
    """
    length, on_a, on_b, P, Q, touches, _ = way
    n = (_plane(a, b, None) if axis is None else (axis,))[0]

    def flat(x):
        return sub(x, scale(dot(n, x), n))

    l_a, e_a = length_of(flat(sub(P, a)))
    l_b, e_b = length_of(flat(sub(b, Q)))
    m_a, m_b = cross(n, e_a), cross(n, e_b)
    x_a, x_b = dot(m_a, a_dot), dot(m_b, b_dot)
    bend = x_a * x_a / l_a + x_b * x_b / l_b
    if inside:
        p = flat(P)
        t_a, t_b = dot(m_a, cross(n, p)), dot(m_b, cross(n, p))
        stiff = t_a * t_a / l_a + t_b * t_b / l_b + dot(sub(e_b, e_a), p)
        moved = t_a * x_a / l_a + t_b * x_b / l_b
        bend = bend - moved * moved / stiff
    if axis is None:
        r_a, r_b = sqrt(dot(a, a)), sqrt(dot(b, b))
        y_a, y_b = dot(n, a_dot) / r_a, dot(n, b_dot) / r_b
        cosine, sine = dot(a, b) / (r_a * r_b), dot(n, cross(a, b)) / (r_a * r_b)
        turn = ((y_a * y_a + y_b * y_b) * cosine - 2.0 * y_a * y_b) / sine
        bend = bend + dot(on_b, cross(n, b)) * turn
        bend = bend + dot(on_b, b) * y_b * y_b - dot(on_a, a) * y_a * y_a
    else:
        rise, rise_dot = dot(axis, sub(b, a)), dot(axis, sub(b_dot, a_dot))
        s, s_dot = sqrt(length * length - rise * rise), dot(e_b, b_dot) - dot(e_a, a_dot)
        along = (s * s_dot + rise * rise_dot) / length
        bend = (s * bend + s_dot * s_dot + rise_dot * rise_dot - along * along) / length
    return where(touches > 0.0, bend, bent_straight(sub(b, a), sub(b_dot, a_dot)))


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
