"""Elastic mesh of two toothed wheels: stiffness, damping, backlash, pressure angle and helix."""

from collections.abc import Mapping
from math import cos, tan
from typing import ClassVar

from dap3d_core.interface import (
    Force,
    Point,
    Vector,
    choice,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import abs as magnitude
from dap3d_core.kernels import (
    add,
    atan2,
    cross,
    dot,
    neg,
    scale,
    sign,
    sqrt,
    sub,
    where,
)
from dap3d_joints.gear import marks, sizes_of
from dap3d_joints.turning import line_rates, wrapped

interface_version = 1


class GearMesh(Force):
    """Teeth of wheels i and j press on one another in the pitch point, and give way there.

    What the joint ``gear`` is for rigid teeth, with the same g, phi, radii and sense s. Along the
    tangent t = a_i x g / |g| the teeth are pressed together by delta, beyond the ``backlash``, and
    they touch on one flank or the other:

        delta = r_i / z_i wrapped(z_i phi_i + s z_j phi_j)
        x = delta - backlash / 2, delta + backlash / 2, or 0 in between
        F = k x + c delta_dot                              where the flanks touch, else 0

    On wheel i in the pitch point act -F t, a part that presses the wheels apart, whichever flank is
    in touch, and one along the axis:

        |F| tan(pressure_angle) / cos(helix)  away from wheel j,  -F tan(helix) a_i

    and their opposites on wheel j; with a ring, away from the flank that is in touch. The force is
    work, and the ledger of a run has it so. Damping ends where the flanks part.
    """

    keyword = "gear"
    synonyms = ("mesh", "gearmesh")
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
    k: float = number(unit="N/m", minimum=0.0, doc="stiffness of the teeth, along the tangent")
    c: float = number(0.0, unit="N s/m", minimum=0.0, doc="damping")
    backlash: float = number(0.0, unit="m", minimum=0.0, doc="play of the teeth, on the circle")
    pressure_angle: float = number(0.3490658503988659, unit="rad", minimum=0.0, maximum=1.0,
                                   doc="of the teeth, 20 deg by default")  # fmt: skip
    helix: float = number(0.0, unit="rad", usual=(-0.8, 0.8), doc="helix angle of wheel i")
    teeth_i: float = number(default=None, minimum=1.0, whole=True, doc="teeth of wheel i")
    teeth_j: float = number(default=None, minimum=1.0, whole=True, doc="teeth of wheel j")
    radius_i: float = number(default=None, unit="m", positive=True, doc="pitch radius of wheel i")
    radius_j: float = number(default=None, unit="m", positive=True, doc="pitch radius of wheel j")
    internal: bool = choice((False, True), False, doc="one wheel is a ring with teeth inside")
    bevel = False

    def prepare(self, bodies):
        i, j = bodies["i"], bodies["j"]
        a, b = i.to_global(self.a_i), j.to_global(self.a_j)
        g = sub(j.place(self.P_j), i.place(self.P_i))
        distance = dot(cross(a, g), cross(a, g)) ** 0.5
        sizes = sizes_of(self, distance)
        sizes["sense"] *= 1.0 if dot(a, b) > 0.0 else -1.0
        sizes |= marks(a, g, i, "i") | marks(b, g, j, "j")
        side = -1.0 if self.internal else 1.0  # a ring presses the wheel in it towards its axis
        sizes["apart"] = side * tan(self.pressure_angle) / cos(self.helix)
        part = sizes["radius_i"] / (sizes["radius_i"] + side * sizes["radius_j"])
        return sizes | {"along": tan(self.helix), "part": part}

    def wrench(
        r_P_i, r_P_j, v_P_i, v_P_j, r_i, r_j, a_i, a_j, w_i, w_j, u_i, m_i, u_j, m_j, teeth_i,
        teeth_j, radius_i, radius_j, sense, apart, along, part, k, c, backlash,
    ):  # fmt: skip
        g, g_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        phi_i, phi_j = atan2(-dot(m_i, g), dot(u_i, g)), atan2(-dot(m_j, g), dot(u_j, g))
        delta = radius_i / teeth_i * wrapped(teeth_i * phi_i + sense * teeth_j * phi_j)
        (k_i, e_i), (k_j, e_j) = line_rates(g, a_i), line_rates(g, a_j)
        t = add(scale(radius_i, k_i), scale(sense * radius_j, k_j))
        e_i, e_j = scale(radius_i, e_i), scale(sense * radius_j, e_j)
        rate = dot(e_i, w_i) + dot(e_j, w_j) - dot(t, g_dot)
        play = 0.5 * backlash
        pressed = k * (delta - play * sign(delta)) + c * rate
        F = where(magnitude(delta) < play, 0.0 * rate, pressed)
        across = sub(g, scale(dot(a_i, g), a_i))
        lift = magnitude(F) * apart / sqrt(dot(across, across))
        f, other = scale(-F, t), add(scale(-lift, across), scale(-F * along, a_i))
        pitch = add(r_P_i, scale(part, g))  # the pitch point
        on_i, on_j = cross(sub(r_P_i, r_i), f), cross(sub(r_P_j, r_j), neg(f))
        n_i = add(sub(on_i, scale(F, e_i)), cross(sub(pitch, r_i), other))
        n_j = sub(sub(on_j, scale(F, e_j)), cross(sub(pitch, r_j), other))
        f = add(f, other)
        return (f, n_i), (neg(f), n_j)

    def switch(r_P_i, r_P_j, u_i, m_i, u_j, m_j, teeth_i, teeth_j, radius_i, sense, backlash):
        g = sub(r_P_j, r_P_i)
        phi_i, phi_j = atan2(-dot(m_i, g), dot(u_i, g)), atan2(-dot(m_j, g), dot(u_j, g))
        delta = radius_i / teeth_i * wrapped(teeth_i * phi_i + sense * teeth_j * phi_j)
        plays = backlash > 0.0
        return where(plays, delta - 0.5 * backlash, 1.0), where(plays, delta + 0.5 * backlash, 1.0)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GearMesh]
