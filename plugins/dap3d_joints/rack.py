"""Rack and pinion, with the tooth force at the pitch point."""

from warnings import warn

from dap3d_core.interface import Joint, Point, Vector, hookimpl, joint_fields, number, point, vector
from dap3d_core.kernels import atan2, cross, dot, sub
from dap3d_joints.turning import wrapped

interface_version = 1

#: The axis of the pinion is normal to the rack up to this.
MISFIT = 1e-6


class Rack(Joint):
    """The pinion, body i, rolls along the direction a_j of the rack, body j.

    The bearings are joints of their own: a hinge of the pinion, a slider of the rack. With
    d = r_Pi - r_Pj, x = a_j . d how far the pinion is along the rack, and phi the angle of a mark
    on the pinion about a_i from a_j, zero in the poses as given:

        C = radius wrapped((x - x_0) / radius - s phi)

    with s = 1 where P_j lies from P_i towards a_i x a_j, s = -1 where it lies on the other side. x
    itself says how often the pinion has turned, so what is wrapped into (-pi, pi] is the error
    alone. The reaction is a force along a_j in the pitch point. J and gamma are derived from C.
    """

    keyword, rows = "rack", 1
    synonyms = ("pinion", "rackandpinion", "rackpin")
    symbol = "link"
    joint_i: str = joint_fields(P_i="P", a_i="a", doc="hinge of the pinion")
    joint_j: str = joint_fields(P_j="P", a_j="a", doc="slider of the rack")
    P_i: Point = point(default=None, doc="on the axis of the pinion; its mass centre by default")
    P_j: Point = point(doc="point on the pitch line of the rack, or on its side of the pinion")
    a_i: Vector = vector(doc="axis of the pinion, on the pinion")
    a_j: Vector = vector(doc="direction of the rack, on the rack")
    radius: float = number(unit="m", positive=True, doc="pitch radius of the pinion")

    def prepare(self, bodies):
        pinion, rack = bodies["i"], bodies["j"]
        a, b = pinion.to_global(self.a_i), rack.to_global(self.a_j)
        if abs(dot(a, b)) > MISFIT:
            warn(
                "the axis a_i of the pinion is not normal to the direction a_j of the rack",
                stacklevel=2,
            )
        d = sub(pinion.place(self.P_i), rack.place(self.P_j))
        sense = 1.0 if dot(d, cross(a, b)) <= 0.0 else -1.0
        return {
            "u_i": pinion.to_local(b),
            "n_j": rack.to_local(cross(a, b)),
            "x_0": dot(b, d),
            "sense": sense,
        }

    def C(r_P_i, r_P_j, u_i, a_j, n_j, x_0, radius, sense):
        phi = atan2(dot(n_j, u_i), dot(a_j, u_i))
        x = dot(a_j, sub(r_P_i, r_P_j)) - x_0
        return radius * wrapped(x / radius - sense * phi)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Rack]
