"""Separating force of rigid teeth, by their pressure angle."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Force,
    Point,
    Vector,
    choice,
    hookimpl,
    joint,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import abs as magnitude
from dap3d_core.kernels import add, cos, cross, dot, neg, scale, sqrt, sub, tan

interface_version = 1


class GearSeparation(Force):
    """What a pressure angle adds to the joint ``gear``: a force that presses its wheels apart.

    Of the tooth force a joint ``gear`` has the part along the tangent, its multiplier lambda, and
    that along the axis. Whichever flank is in touch, the pressure angle adds a part across them,
    which bearings carry:

        |lambda| tan(pressure_angle) / cos(helix)

    away from wheel j on wheel i, and its opposite on wheel j, with a ring away from the teeth in
    touch; along the line from axis to axis in the plane of P_i normal to a_i. Where the axes keep
    their distance it does no work. The force ``gear``, an elastic mesh, has this part by itself.
    """

    keyword = "gear_separation"
    synonyms = ("pressure-angle", "separating-force")
    example: ClassVar[Mapping[str, str]] = {
        "P_i": '"crank.O"',
        "P_j": '"rod.O"',
        "a_i": '"crank.y"',
    }
    mesh: str = joint(rows=1, doc="the joint gear of the two wheels")
    joint_i: str = joint_fields(P_i="P", a_i="a", doc="hinge of wheel i")
    joint_j: str = joint_fields(P_j="P", doc="hinge of wheel j")
    P_i: Point = point(default=None, doc="on the axis of wheel i; its mass centre when left out")
    P_j: Point = point(default=None, doc="on the axis of wheel j; its mass centre when left out")
    a_i: Vector = vector(doc="axis of wheel i, on the wheel")
    pressure_angle: float = number(0.3490658503988659, unit="rad", minimum=0.0, maximum=1.0,
                                   doc="of the teeth, 20 deg by default")  # fmt: skip
    helix: float = number(0.0, unit="rad", usual=(-0.8, 0.8), doc="that of the joint gear")
    internal: bool = choice((False, True), False, doc="one wheel is a ring with teeth inside")

    def prepare(self, bodies):
        return {"side": -1.0 if self.internal else 1.0}

    def wrench(r_P_i, r_P_j, s_P_i, r_j, a_i, lam_mesh, pressure_angle, helix, side):
        g = sub(r_P_j, r_P_i)
        across = sub(g, scale(dot(a_i, g), a_i))
        size = side * magnitude(lam_mesh[0]) * tan(pressure_angle) / cos(helix)
        f = scale(-size / sqrt(dot(across, across)), across)
        return (f, cross(s_P_i, f)), (neg(f), neg(cross(sub(add(r_P_i, across), r_j), f)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GearSeparation]
