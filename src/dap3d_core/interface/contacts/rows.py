"""Kernels of every contact, of its point c and normal n: three rows, which its mode masks.

In mode 1 and 2 the normal row holds, in mode 2 (sticking) the two tangents as well; a masked row is
zero, and its multiplier too (linear/ldlt/factor.py). Sliding friction is a force that reads the
multiplier of the normal (formulations/common/friction.py). ``near`` is a force that the contact is
given besides: of contacts that share what they carry, the one that all cones allow.
"""

# Kernels take numbers of any kind: floats, and symbols of a trace.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from typing import Any

from dap3d_core.kernels import add, cross, dot, neg, row, scale, sqrt, sub, where

#: Modes of a contact; in the last one, of time stepping, all rows hold as where it sticks.
OPEN, SLIDES, STICKS, STEPPED = 0.0, 1.0, 2.0, 3.0
#: Speed, m/s of a scene of ordinary size, below which friction points against the direction in
#: which sliding began: ``way``, whose length is that of the scene, m (1 of what turns).
STILL = 1e-8
#: The same of friction in an ellipse, which turns slip all the way to its end.
STILL_IN_ELLIPSE = 1e-10
#: The same of slip along rows that do not hold, above which modes are found anew: at rest, still
#: (``still_speed``).
STRAYED = 5e-10
#: Gap, m, of what does not touch as its surfaces end before.
APART = 1.0
#: The same in time stepping, which leaves out what is as far apart.
FAR_APART = 1e300
#: z of normals below which tangents have signs of their own: of no floor, wall or ceiling.
TURNED = -0.43
_ZERO = (0.0, 0.0, 0.0)
_NONE = row(_ZERO, _ZERO)


def closed(mode):
    """True where the normal row holds."""
    return mode > 0.5


def held(mode):
    """True where the tangents hold as well."""
    return mode > 1.5


def holds(mode, way, k):
    """True where row k of friction holds: where it sticks, but for those that joints hold.

    The components of ``way`` name these, by the length of the scene; it is a direction of sliding
    in mode 1 alone.
    """
    return held(mode) & (way[k] <= 0.0)


def presses(mode, way):
    """True where the normal row holds: where it is closed, but for those that joints hold."""
    return closed(mode) & ((mode < 1.5) | (way[0] <= 0.0))


def before_straying(rest, slip, way):
    """The rest of a cone, negative also where slip grows along rows that others hold no longer.

    A driver that begins to move is among these. Slip is still that of rest then, and what contacts
    do is found anew. At rest it is the rest itself, whose slope shows an end within a step.
    """
    x, y, z = (where(a > 0.0, u, 0.0) for a, u in zip(way, slip, strict=True))
    square = STRAYED**2 * dot(way, way)
    left = 1.0 - (x * x + y * y + z * z) / where(square > 0.0, square, 1.0)
    return where(rest > 0.0, left, 1.0) * rest


def tangents(n, grain=None):
    """Two unit vectors across a normal, the first along a grain; None: any two.

    Of a normal that turns they turn smoothly, but where it passes TURNED (Duff et al., Building an
    orthonormal basis, revisited, J. Comput. Graph. Tech. 6, 2017): multipliers along axes that
    change with rounding would keep an implicit step from converging.
    """
    if grain is None:
        x, y, z = n
        up = where(z < TURNED, -1.0, 1.0)
        a = -1.0 / (up + z)
        return (1.0 + up * x * x * a, up * x * y * a, -up * x), (x * y * a, up + y * y * a, -y)
    a = across(grain, n)
    first = scale(1.0 / sqrt(dot(a, a)), a)
    return first, cross(n, first)


def tangent_rates(n, n_dot, grain=None, grain_dot=None):
    """Rates of ``tangents``."""
    if grain is None:
        (x, y, z), (x_dot, y_dot, z_dot) = n, n_dot
        up = where(z < TURNED, -1.0, 1.0)
        a = -1.0 / (up + z)
        a_dot = a * a * z_dot
        xy_dot = (x_dot * y + x * y_dot) * a + x * y * a_dot
        xx_dot = 2.0 * x * x_dot * a + x * x * a_dot
        yy_dot = 2.0 * y * y_dot * a + y * y * a_dot
        return (up * xx_dot, up * xy_dot, -up * x_dot), (xy_dot, yy_dot, -y_dot)
    a, turn = across(grain, n), dot(grain_dot, n) + dot(grain, n_dot)
    a_dot = sub(sub(grain_dot, scale(turn, n)), scale(dot(grain, n), n_dot))
    size = sqrt(dot(a, a))
    first = scale(1.0 / size, a)
    first_dot = scale(1.0 / size, sub(a_dot, scale(dot(first, a_dot), first)))
    return first_dot, add(cross(n_dot, first), cross(n, first_dot))


def position(gap, mode):
    """C: the gap of a closed contact."""
    return where(closed(mode), gap, 0.0)


def position_within(gap, reach, mode):
    """The same of surfaces that end; in time stepping they are far apart beyond their ends."""
    is_beyond = (mode > 0.5 * (STICKS + STEPPED)) & (reach < 0.0)
    return where(is_beyond, FAR_APART, position(gap, mode))


def blocks(c, n, grain, r_i, r_j, mode, way):
    """J of both bodies."""
    first, second = tangents(n, grain)
    directions = (
        where(presses(mode, way), n, _ZERO),
        where(holds(mode, way, 1), first, _ZERO),
        where(holds(mode, way, 2), second, _ZERO),
    )
    s_i, s_j = sub(c, r_i), sub(c, r_j)
    return (
        tuple(row(e, cross(s_i, e)) for e in directions),
        tuple(row(neg(e), neg(cross(s_j, e))) for e in directions),
    )


def slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j):
    """Velocity at the point of contact of body i less that of body j."""
    of_i = add(v_i, cross(w_i, sub(c, r_i)))
    return sub(of_i, add(v_j, cross(w_j, sub(c, r_j))))


def gamma(c, c_dot, n, n_dot, grain, grain_dot, r_i, v_i, w_i, r_j, v_j, w_j, mode, way):
    """-J_dot v, for a point of contact and a normal that move."""
    slip = slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)
    bent = sub(cross(w_i, sub(c_dot, v_i)), cross(w_j, sub(c_dot, v_j)))
    first, second = tangents(n, grain)
    first_dot, second_dot = tangent_rates(n, n_dot, grain, grain_dot)
    pairs = (n, n_dot), (first, first_dot), (second, second_dot)
    values = tuple(-dot(e_dot, slip) - dot(e, bent) for e, e_dot in pairs)
    return (
        where(presses(mode, way), values[0], 0.0),
        where(holds(mode, way, 1), values[1], 0.0),
        where(holds(mode, way, 2), values[2], 0.0),
    )


def across(vector, n):
    """The part of a vector across a normal."""
    return sub(vector, scale(dot(vector, n), n))


def unit(vector):
    """A vector of length 1 in the direction of another; zero of that of zero."""
    length = sqrt(dot(vector, vector))
    return scale(1.0 / where(length > 0.0, length, 1.0), vector)


def direction(slip, n, way, still=STILL):
    """Unit vector of sliding; through zero it goes on as it was, so that no step sees a jump.

    Of slow slip that in which sliding began has a part, of (still / |u|)^3 soon: slip that turns
    while it is next to nothing would ask for steps as short as that.
    """
    u, w = across(slip, n), across(way, n)
    square, ahead = dot(w, w), dot(u, w)
    slow = still * still * square + dot(u, u)
    size = where(square > 0.0, square * slow, 1.0)  # u and its change times that: no division
    part = still**3 * square * square - where(ahead < 0.0, 2.0 * ahead, 0.0) * slow
    return unit(add(scale(size, u), scale(part, w)))


def sliding(u, n, grain, grip, way):
    """Direction of a slip u, and the coefficients there.

    The speed is that in this direction: less than zero beyond the end of a slip.
    """
    d = direction(u, n, way, STILL if grain is None else STILL_IN_ELLIPSE)
    return d, grip(dot(across(u, n), d))


def resistance(normal, d, frame, mu):
    """Sliding friction against a direction d, of two coefficients within an ellipse."""
    if not isinstance(mu, tuple):
        return scale(-mu * normal, d)
    parts = [k * k * dot(d, e) for k, e in zip(mu, frame, strict=True)]
    square = parts[0] * dot(d, frame[0]) + parts[1] * dot(d, frame[1])
    size = sqrt(where(square > 0.0, square, 1.0))
    return scale(-normal / size, add(scale(parts[0], frame[0]), scale(parts[1], frame[1])))


def forces(c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near):
    """Normal force, friction on body i (3), both with what ``near`` gives."""
    first, second = frame = tangents(n, grain)
    normal = where(closed(mode), lam[0] + dot(near, n), 0.0)
    u = slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)
    d, mu = sliding(u, n, grain, grip, way)
    if isinstance(mu, tuple) and (grain is None or len(mu) != 2):
        raise ValueError(
            "grip should return one coefficient, or those along a vector grain and across it"
        )
    slides = resistance(normal, d, frame, mu)
    sticks = add(add(scale(lam[1], first), scale(lam[2], second)), across(near, n))
    friction = where(held(mode), sticks, where(closed(mode), slides, _ZERO))
    return normal, friction


def friction(c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near):
    """What acts besides the rows: sliding friction, and ``near``."""
    _, tangential = forces(c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near)
    slides = where(held(mode), across(near, n), tangential)
    force = add(where(closed(mode), scale(dot(near, n), n), _ZERO),
                where(closed(mode), slides, _ZERO))  # fmt: skip
    return (
        (force, cross(sub(c, r_i), force)),
        (neg(force), neg(cross(sub(c, r_j), force))),
    )


def switch(
    gap, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, hold, mode, way, near, unit_mass
):
    """What ends a mode where it is negative: gap, normal force; slip, rest of a cone.

    Forces are divided by the mass ``unit_mass``: a rest that is rounding (formulations/switches.py)
    is so in scenes of milligrams as well.
    """
    normal, tangential = forces(
        c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near
    )
    slip = slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)
    mu, mu_s, held_by = pair(grip(0.0))[0], pair(hold)[0], tangential
    if isinstance(hold, tuple):  # an ellipse, stretched to a circle
        first, second = tangents(n, grain)
        part = hold[0] / where(hold[1] > 0.0, hold[1], 1.0)
        held_by = (dot(tangential, first), part * dot(tangential, second), 0.0)
    slides = where(mu > 0.0, dot(slip, unit(across(way, n))), 1.0)
    rest = (mu_s * normal - sqrt(dot(held_by, held_by))) / unit_mass
    along = tuple(dot(slip, e) for e in (n, *tangents(n, grain)))
    sticks = before_straying(where(mu_s > 0.0, rest, 1.0), along, way)
    return (
        where(closed(mode), normal / unit_mass, gap),
        where(held(mode), sticks, where(closed(mode), slides, 1.0)),
    )


def switch_within(
    gap, reach, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, hold, mode, way, near,
    unit_mass,
):  # fmt: skip
    """The same of surfaces that end: the reach as well, of what is closed."""
    ends, slips = switch(
        gap, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, hold, mode, way, near, unit_mass
    )
    open_, held_within = where(reach < 0.0, APART, ends), where(reach < ends, reach, ends)
    return where(closed(mode), held_within, open_), slips


def knot(seam, mode):
    """Numbers that change sign between parts of surfaces, where it is closed."""
    parts = seam if isinstance(seam, tuple) else (seam,)
    return tuple(where(closed(mode), x, 1.0) for x in parts)


def rate(mode, way, near):
    """Mode, direction and shares stay between events."""
    return 0.0, _ZERO, _ZERO


def output(gap, reach, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near):
    """Of results: gap, normal force, friction on body i (3), slip (3), point of contact (3), reach,
    force on body i (3).
    """
    normal, tangential = forces(
        c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near
    )
    slip = across(slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j), n)
    force = add(scale(normal, n), tangential)
    return (gap, normal, *tangential, *slip, *c, reach, *force)


def pair(mu):
    """Coefficients along two tangents."""
    return mu if isinstance(mu, tuple) else (mu, mu)


def output_with_law(
    gap, reach, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, hold, mode, way, near
):
    """The same, and coefficients along both tangents where it slides so, and where it sticks."""
    u = slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)
    _, mu = sliding(u, n, grain, grip, way)
    known = output(
        gap, reach, c, n, grain, r_i, v_i, w_i, r_j, v_j, w_j, lam, grip, mode, way, near
    )
    return (*known, *pair(mu), *pair(hold))


def turning_blocks(n, mode):
    """J of both bodies."""
    u = where(closed(mode), n, _ZERO)
    return (row(_ZERO, u), _NONE, _NONE), (row(_ZERO, neg(u)), _NONE, _NONE)


def turning_gamma(n_dot, w_i, w_j, mode):
    """-J_dot v."""
    return where(closed(mode), -dot(n_dot, sub(w_i, w_j)), 0.0), 0.0, 0.0


def moment(n, lam, mode, near):
    """The moment along the normal, with what ``near`` gives."""
    return where(closed(mode), lam[0] + dot(near, n), 0.0)


def turning_friction(n, mode, near):
    """What acts besides the row: ``near``, a moment here."""
    given = where(closed(mode), scale(dot(near, n), n), _ZERO)
    return (_ZERO, given), (_ZERO, neg(given))


def turning_switch(gap, n, lam, mode, near, unit_mass):
    """What ends a mode where it is negative: the gap, or the moment."""
    return where(closed(mode), moment(n, lam, mode, near) / unit_mass, gap), 1.0


def turning_output(gap, n, lam, mode, near):
    """As ``output``; the normal force is a moment, and there is no point of contact."""
    return (gap, moment(n, lam, mode, near), *_ZERO, *_ZERO, *_ZERO, 1.0, *_ZERO)


KERNELS = {"C": position, "J": blocks, "gamma": gamma, "friction": friction, "switch": switch,
           "rate": rate, "tension": output}  # fmt: skip
#: Those in their place, by what a type of contact declares.
KERNELS_WITH: dict[str, dict[str, Any]] = {
    "reach": {"C": position_within, "switch": switch_within},
    "seam": {"knot": knot},
    "grip": {"tension": output_with_law},
}
#: Of a contact whose gap is an angle: one row, of a moment about its normal. The two rows across
#: stay zero, as those of a contact that slides.
TURNING = {"C": position, "J": turning_blocks, "gamma": turning_gamma, "rate": rate,
           "friction": turning_friction, "switch": turning_switch,
           "tension": turning_output}  # fmt: skip
