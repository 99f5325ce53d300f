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
from dap3d_joints.gear import PRESSURE_ANGLE, pitch_of

interface_version = 1


class GearSeparation(Force):
    """What a pressure angle adds to the joint ``gear``: a force that presses its wheels apart.

    A joint ``gear`` brings it by its own ``pressure_angle``, and its equations stand there; here it
    is for wheels that mesh by a joint of another type, of one row, whose multiplier lambda is the
    force along the tangent. It acts along the line from axis to axis in the plane of P_i normal to
    a_i, of bevel gears where the pitch cones touch:

        |lambda| tan(pressure_angle) / cos(helix)

    Where the axes keep their distance it does no work.
    """

    keyword = "gear_separation"
    synonyms = ("pressure-angle", "separating-force")
    example: ClassVar[Mapping[str, str]] = {
        "P_i": '"crank.O"',
        "P_j": '"rod.O"',
        "a_i": '"crank.y"',
        "a_j": '"rod.y"',
    }
    mesh: str = joint(rows=1, doc="the joint gear of the two wheels")
    joint_i: str = joint_fields(P_i="P", a_i="a", doc="hinge of wheel i")
    joint_j: str = joint_fields(P_j="P", a_j="a", doc="hinge of wheel j")
    P_i: Point = point(default=None, doc="on the axis of wheel i; its mass centre when left out")
    P_j: Point = point(default=None, doc="on the axis of wheel j; its mass centre when left out")
    a_i: Vector = vector(doc="axis of wheel i, on the wheel")
    a_j: Vector = vector(doc="axis of wheel j")
    pressure_angle: float = number(PRESSURE_ANGLE, unit="rad", minimum=0.0, maximum=1.0,
                                   doc="of the teeth, 20 deg by default")  # fmt: skip
    helix: float = number(0.0, unit="rad", usual=(-0.8, 0.8), doc="that of the joint gear")
    radius_i: float = number(default=None, unit="m", positive=True, doc="of a bevel gear i")
    radius_j: float = number(default=None, unit="m", positive=True, doc="of a bevel gear j")
    internal: bool = choice((False, True), False, doc="one wheel is a ring with teeth inside")
    bevel: bool = choice((False, True), False, doc="the axes meet")

    def prepare(self, bodies):
        side = -1.0 if self.internal else 1.0
        sizes = {"radius_i": self.radius_i or 0.0, "radius_j": self.radius_j or 0.0}
        if not self.bevel:
            size = side * tan(self.pressure_angle) / cos(self.helix)
            return sizes | {"size": size, "at": (0.0, 0.0), "apart": (0.0, 0.0)}
        if not all(sizes.values()):
            raise ValueError("of bevel gears give radius_i and radius_j")
        a, b = bodies["i"].to_global(self.a_i), bodies["j"].to_global(self.a_j)
        pitch = pitch_of(a, b, self.radius_i, self.radius_j, side)
        del pitch["lever"]
        return sizes | pitch | {"size": tan(self.pressure_angle)}

    def wrench(r_P_i, r_P_j, s_P_i, r_j, a_i, lam_mesh, size):
        g = sub(r_P_j, r_P_i)
        across = sub(g, scale(dot(a_i, g), a_i))
        f = scale(-magnitude(lam_mesh[0]) * size / sqrt(dot(across, across)), across)
        return (f, cross(s_P_i, f)), (neg(f), neg(cross(sub(add(r_P_i, across), r_j), f)))


class BevelSeparation(GearSeparation, bevel=True):
    """The axes meet."""

    def wrench(r_P_i, r_i, r_j, a_i, a_j, lam_mesh, size, at, apart):
        pitch = add(r_P_i, add(scale(at[0], a_i), scale(at[1], a_j)))
        f = add(scale(apart[0], a_i), scale(apart[1], a_j))
        f = scale(magnitude(lam_mesh[0]) * size, f)
        return (f, cross(sub(pitch, r_i), f)), (neg(f), neg(cross(sub(pitch, r_j), f)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GearSeparation]
