"""Gear pair: two toothed wheels in mesh, with the tooth force at the pitch point."""

from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar
from warnings import warn

import attrs

from dap3d_core.interface import (
    Joint,
    Point,
    Vector,
    choice,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import add, atan2, cross, dot, neg, norm2, row, scale, sqrt, sub, tan
from dap3d_joints.turning import line_accelerations, line_rates, wrapped

interface_version = 1

#: Numbers of teeth at most that stand for a ratio of radii.
MOST_TEETH = 1000
#: Radii may miss the distance of the axes, and axes be askew, by this part.
MISFIT = 1e-6
#: 20 deg, in rad.
PRESSURE_ANGLE = 0.3490658503988659


class Wheels:
    """Fields of two toothed wheels in mesh."""

    example: ClassVar[Mapping[str, str]] = {
        "P_i": '"crank.O"',
        "P_j": '"rod.O"',
        "a_i": '"crank.y"',
        "a_j": '"rod.y"',
        "teeth_i": "20",
        "teeth_j": "40",
    }
    joint_i: str = joint_fields(P_i="P", a_i="a", doc="hinge of wheel i")
    joint_j: str = joint_fields(P_j="P", a_j="a", doc="hinge of wheel j")
    P_i: Point = point(default=None, doc="on the axis of wheel i; its mass centre when left out")
    P_j: Point = point(default=None, doc="on the axis of wheel j; its mass centre when left out")
    a_i: Vector = vector(doc="axis of wheel i, on the wheel")
    a_j: Vector = vector(doc="axis of wheel j, on the wheel, or on ground for a fixed ring")
    teeth_i: float = number(default=None, minimum=1.0, whole=True, doc="teeth of wheel i")
    teeth_j: float = number(default=None, minimum=1.0, whole=True, doc="teeth of wheel j")
    radius_i: float = number(default=None, unit="m", positive=True, doc="pitch radius of wheel i")
    radius_j: float = number(default=None, unit="m", positive=True, doc="pitch radius of wheel j")
    pressure_angle: float = number(PRESSURE_ANGLE, unit="rad", minimum=0.0, maximum=1.0,
                                   doc="of the teeth, 20 deg by default")  # fmt: skip
    helix: float = number(0.0, unit="rad", usual=(-0.8, 0.8), doc="helix angle of wheel i")
    internal: bool = choice((False, True), False, doc="one wheel is a ring with teeth inside")
    bevel: bool = choice((False, True), False, doc="the axes meet")


attrs.define(Wheels, slots=False, kw_only=True)


class Gear(Wheels, Joint):
    """Wheels i and j stay in mesh; the reaction is a force at the pitch point of both.

    The bearings are joints of their own, and carry the tooth force; wherever they are, on ground or
    on a carrier that turns itself, the axes stay at their distance. With g = r_Pj - r_Pi from one
    axis to the other, and phi_i, phi_j the angles from g to marks on the wheels about a_i and a_j,
    zero in the poses as given, the pitch circles roll on one another:

        C = r_i / z_i wrapped(z_i phi_i + s z_j phi_j) + tan(helix) (a_i . g - x_0)

    with radii r, numbers of teeth z, and s = 1 for teeth outside on both wheels, s = -1 where one
    is a ring with teeth inside; the opposite where a_i and a_j point against each other. Whole
    turns are whole numbers of teeth, so what is wrapped into (-pi, pi] is the error alone. The
    gradient of C is a unit force along the tangent in the pitch point. With a ``helix`` it has a
    part along the axis; it is the angle of the teeth of wheel i, positive for a right-handed one.

    With ``bevel`` the axes meet: P_i and P_j are that point on each wheel, both axes point from
    there to the wheels, and phi is measured from the other axis. r_i / r_j is z_i / z_j, and the
    radius a length of one's choice: the larger end's, as the tooth force is the torque over it.

    Radii follow from the numbers of teeth and the distance of the axes, or are given in their
    place. The row has the part of the tooth force along the tangent, its multiplier lambda. With a
    ``pressure_angle`` it lies at that angle: besides, a force presses the wheels apart, whichever
    flank is in touch, which the bearings carry and the reaction of the joint contains:

        |lambda| tan(pressure_angle) / cos(helix)

    away from wheel j on wheel i, with a ring away from the teeth in touch; of bevel gears normal to
    the line in which the pitch cones touch, which loads the bearings along the axes, too. Where
    joints hold the axes it moves nothing. Beside contacts it is left out. Axes held by springs move
    apart by it, and then have play: take the force ``gear``, an elastic mesh. 0 is the force along
    the tangent alone, and costs less.

    phi_i changes at the rate -k_i . g_dot + e_i . w_i, with k_i = a_i x g / |a_i x g|^2 and
    e_i = g x k_i, which give J and gamma (turning.py).
    """

    keyword, rows = "gear", 1
    synonyms = ("gears", "gearpair", "spur", "bevel", "spur-gear", "bevel-gear")
    symbol = "link"
    brings = ("pressure_angle", "gear_separation", "mesh")

    def prepare(self, bodies):
        return meshing(self, bodies)

    def C(r_P_i, r_P_j, a_i, u_i, m_i, u_j, m_j, teeth_i, teeth_j, radius_i, sense, helix, x_0):
        g = sub(r_P_j, r_P_i)
        phi_i, phi_j = atan2(-dot(m_i, g), dot(u_i, g)), atan2(-dot(m_j, g), dot(u_j, g))
        roll = wrapped(teeth_i * phi_i + sense * teeth_j * phi_j)
        return radius_i / teeth_i * roll + tan(helix) * (dot(a_i, g) - x_0)

    def J(r_P_i, r_P_j, s_P_i, s_P_j, a_i, a_j, teeth_i, teeth_j, radius_i, sense, helix):
        g, r_j = sub(r_P_j, r_P_i), sense * radius_i * teeth_j / teeth_i
        (k_i, e_i), (k_j, e_j) = line_rates(g, a_i), line_rates(g, a_j)
        axial = tan(helix)
        F = sub(add(scale(radius_i, k_i), scale(r_j, k_j)), scale(axial, a_i))
        n_i = add(scale(radius_i, e_i), scale(axial, cross(a_i, g)))
        return row(F, add(cross(s_P_i, F), n_i)), row(neg(F), sub(scale(r_j, e_j), cross(s_P_j, F)))

    def gamma(
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, a_i, a_j, a_i_dot, a_j_dot, w_i, w_j,
        teeth_i, teeth_j, radius_i, sense, helix,
    ):  # fmt: skip
        g, g_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        r_j, axial = sense * radius_i * teeth_j / teeth_i, tan(helix)
        k_i, k_j = line_rates(g, a_i)[0], line_rates(g, a_j)[0]
        k_i_dot, e_i_dot = line_accelerations(g, a_i, g_dot, a_i_dot)
        k_j_dot, e_j_dot = line_accelerations(g, a_j, g_dot, a_j_dot)
        F = sub(add(scale(radius_i, k_i), scale(r_j, k_j)), scale(axial, a_i))
        F_dot = sub(add(scale(radius_i, k_i_dot), scale(r_j, k_j_dot)), scale(axial, a_i_dot))
        bend = sub(cross(w_j, s_P_j_dot), cross(w_i, s_P_i_dot))
        turn = add(cross(a_i_dot, g), cross(a_i, g_dot))
        rolls = radius_i * dot(e_i_dot, w_i) + r_j * dot(e_j_dot, w_j)
        return dot(F_dot, g_dot) + dot(F, bend) - rolls - axial * dot(turn, w_i)


class BevelGear(Gear, bevel=True):
    """The axes meet."""

    def C(r_P_i, r_P_j, a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, teeth_j, radius_i, sense, lever):
        phi_i, phi_j = atan2(-dot(m_i, a_j), dot(u_i, a_j)), atan2(-dot(m_j, a_i), dot(u_j, a_i))
        roll = wrapped(teeth_i * phi_i + sense * teeth_j * phi_j)
        return radius_i / teeth_i * roll - lever * dot(cross(a_i, a_j), sub(r_P_j, r_P_i))

    def J(r_P_i, r_P_j, s_P_i, s_P_j, a_i, a_j, teeth_i, teeth_j, radius_i, sense, lever):
        g, e = sub(r_P_j, r_P_i), turn_of(a_i, a_j, radius_i, sense * radius_i * teeth_j / teeth_i)
        F = scale(lever, cross(a_i, a_j))
        n_i = sub(e, scale(lever, cross(a_i, cross(a_j, g))))
        n_j = add(e, scale(lever, cross(a_j, cross(g, a_i))))
        return row(F, add(cross(s_P_i, F), n_i)), row(neg(F), neg(add(cross(s_P_j, F), n_j)))

    def gamma(
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, a_i, a_j, a_i_dot, a_j_dot, w_i, w_j,
        teeth_i, teeth_j, radius_i, sense, lever,
    ):  # fmt: skip
        g, g_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        r_j = sense * radius_i * teeth_j / teeth_i
        e_i_dot = line_accelerations(a_j, a_i, a_j_dot, a_i_dot)[1]
        e_j_dot = line_accelerations(a_i, a_j, a_i_dot, a_j_dot)[1]
        e_dot = sub(scale(radius_i, e_i_dot), scale(r_j, e_j_dot))
        t, t_dot = cross(a_i, a_j), add(cross(a_i_dot, a_j), cross(a_i, a_j_dot))
        bend = sub(cross(w_j, s_P_j_dot), cross(w_i, s_P_i_dot))
        n_i = add(
            cross(a_i_dot, cross(a_j, g)),
            cross(a_i, add(cross(a_j_dot, g), cross(a_j, g_dot))),
        )
        n_j = add(
            cross(a_j_dot, cross(g, a_i)),
            cross(a_j, add(cross(g_dot, a_i), cross(g, a_i_dot))),
        )
        apex = dot(t_dot, g_dot) + dot(t, bend) + dot(n_i, w_i) + dot(n_j, w_j)
        return lever * apex - dot(e_dot, sub(w_i, w_j))


def meshing(gear, bodies):
    """Constants of a pair of wheels: sizes, marks, x_0, and of bevel gears the lever.

    The lever times a_i x a_j is the tangent in the pitch point.
    """
    i, j = bodies["i"], bodies["j"]
    a, b = i.to_global(gear.a_i), j.to_global(gear.a_j)
    g = sub(j.place(gear.P_j), i.place(gear.P_i))
    sizes = sizes_of(gear, length(across(g, a)))
    if gear.bevel:
        if length(g) > MISFIT * sizes["radius_i"]:
            warn(
                "P_i and P_j are apart; of bevel gears both are the point where the axes meet",
                stacklevel=2,
            )
        if gear.helix:
            warn("helix is not used by bevel gears", stacklevel=2)
        lever = pitch_of(a, b, sizes["radius_i"], sizes["radius_j"], sizes["sense"])["lever"]
        return sizes | marks(a, b, i, "i") | marks(b, a, j, "j") | {"x_0": 0.0, "lever": lever}
    if length(cross(a, b)) > MISFIT:
        warn("a_i and a_j are not parallel; where the axes meet write bevel = true, and name "
             "the point where they do", stacklevel=2)  # fmt: skip
    sizes["sense"] *= 1.0 if dot(a, b) > 0.0 else -1.0
    sizes |= marks(a, g, i, "i") | marks(b, g, j, "j")
    return sizes | {"x_0": dot(a, g), "lever": 0.0}


def pitch_of(a, b, r_i, r_j, side):
    """Of bevel gears with axes a, b that meet: what tooth forces need, by parts of a_i and a_j.

    The lever; ``at``, where the pitch cones touch, from the point where the axes meet; ``apart``,
    the unit vector across that line by which a tooth force presses wheel i away from wheel j.

    Args:
        a, b: unit vectors along the axes, towards the wheels.
        r_i, r_j: pitch radii.
        side: 1, or -1 where one wheel is a ring.

    Raises:
        ValueError: the axes are parallel.
    """
    c, s = dot(a, b), length(cross(a, b))
    if not s > MISFIT:
        raise ValueError("the axes of bevel gears meet, and these are parallel: bevel = false")
    lever = (side if r_j + side * r_i > 0.0 else -side) / s
    cone = sqrt(r_i * r_i + r_j * r_j + 2.0 * side * r_i * r_j * c)
    across_it = side * lever / cone
    return {
        "lever": lever,
        "at": (lever * side * r_j, lever * r_i),
        "apart": (across_it * (side * r_j * c + r_i), -across_it * (side * r_j + r_i * c)),
    }


def turn_of(a_i, a_j, r_i, r_j):
    """What of the roll of bevel gears is e . (w_i - w_j)."""
    return sub(scale(r_i, line_rates(a_j, a_i)[1]), scale(r_j, line_rates(a_i, a_j)[1]))


def length(a):
    """The length of a vector."""
    return sqrt(norm2(a))


def across(g, a):
    """The part of g normal to the unit vector a."""
    return sub(g, scale(dot(a, g), a))


def marks(a, g, pose, slot):
    """U and m on a wheel, by which the angle of g about its axis a is measured: zero now."""
    u = across(g, a)
    u = scale(1.0 / length(u), u)
    return {f"u_{slot}": pose.to_local(u), f"m_{slot}": pose.to_local(cross(a, u))}


def sizes_of(gear, distance):
    """Numbers of teeth, pitch radii and sense of a pair whose axes have a distance."""
    sense = -1.0 if gear.internal else 1.0
    z_i, z_j, r_i, r_j = gear.teeth_i, gear.teeth_j, gear.radius_i, gear.radius_j
    if (z_i is None) != (z_j is None) or (r_i is None) != (r_j is None):
        raise ValueError("one wheel has a size, the other none: give teeth_i and teeth_j, or "
                         "radius_i and radius_j, or all")  # fmt: skip
    if z_i is None and r_i is None:
        warn("the wheels are taken to be of one size; give teeth_i and teeth_j", stacklevel=2)
        z_i = z_j = 1.0
    if z_i is None:
        ratio = Fraction(r_j / r_i).limit_denominator(MOST_TEETH)
        z_i, z_j = float(ratio.denominator), float(ratio.numerator)
    if gear.internal and z_i == z_j:
        raise ValueError("a ring and the wheel in it are not of the same size")
    if r_i is None and gear.bevel:
        raise ValueError("of bevel gears give radius_i and radius_j, too: the tooth force is the "
                         "torque over them")  # fmt: skip
    if not (gear.bevel or distance > 0.0):
        raise ValueError("the axes are one; wheels in mesh have axes at a distance")
    if r_i is None:
        r_i, r_j = (distance * z / abs(z_i + sense * z_j) for z in (z_i, z_j))
    elif abs(r_i * z_j - r_j * z_i) > MISFIT * r_i * z_j:
        warn(
            f"the radii are as {r_i:g} to {r_j:g}, the teeth as {z_i:g} to {z_j:g}; these hold",
            stacklevel=2,
        )
    apart = abs(r_i + sense * r_j)
    if not gear.bevel and abs(apart - distance) > MISFIT * distance:
        warn(f"the axes are {distance:.9g} m apart, and wheels of these radii {apart:.9g} m: the "
             "reaction is no force in one point", stacklevel=2)  # fmt: skip
    return {"teeth_i": z_i, "teeth_j": z_j, "radius_i": r_i, "radius_j": r_j, "sense": sense}


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Gear]
