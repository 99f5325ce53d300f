"""Rack and pinion, with the tooth force at the pitch point."""

from collections.abc import Mapping
from typing import ClassVar
from warnings import warn

from dap3d_core.interface import Joint, Point, Vector, hookimpl, joint_fields, number, point, vector
from dap3d_core.kernels import add, atan2, cross, dot, row, scale, sqrt, sub
from dap3d_joints.relative_rows import offset_gamma, offset_rows
from dap3d_joints.turning import line_accelerations, line_rates, wrapped

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
    alone. The reaction is a force along a_j in the pitch point. The rate of
    phi is e . (w_i - w_j), with e = u_i x (b_j x u_i) / |b_j x u_i|^2, b_j the axis on the rack.
    """

    keyword, rows = "rack", 1
    synonyms = ("pinion", "rackandpinion", "rackpin")
    symbol = "link"
    example: ClassVar[Mapping[str, str]] = {
        "P_j": '"ground.O"',
        "a_i": '"crank.y"',
        "a_j": '"ground.x"',
    }
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
        d, n = sub(pinion.place(self.P_i), rack.place(self.P_j)), cross(a, b)
        if not dot(n, n) > MISFIT**2:
            raise ValueError("the axis a_i of the pinion lies along a_j; it is normal to the rack")
        n = scale(1.0 / sqrt(dot(n, n)), n)
        side = -dot(d, n)
        if not abs(side) > MISFIT * self.radius:
            raise ValueError("P_j is level with the axis of the pinion, and does not say on which "
                             "side the rack lies: give a point on its pitch line")  # fmt: skip
        return {
            "u_i": pinion.to_local(b),
            "n_j": rack.to_local(n),
            "b_j": rack.to_local(cross(b, n)),
            "x_0": dot(b, d),
            "sense": 1.0 if side > 0.0 else -1.0,
        }

    def C(r_P_i, r_P_j, u_i, a_j, n_j, x_0, radius, sense):
        phi = atan2(dot(n_j, u_i), dot(a_j, u_i))
        x = dot(a_j, sub(r_P_i, r_P_j)) - x_0
        return radius * wrapped(x / radius - sense * phi)

    def J(r_P_i, r_j, s_P_i, u_i, a_j, b_j, radius, sense):
        x_i, x_j = offset_rows(a_j, s_P_i, r_P_i, r_j)
        e = scale(sense * radius, line_rates(u_i, b_j)[1])
        return row(x_i[:3], sub(x_i[3:], e)), row(x_j[:3], add(x_j[3:], e))

    def gamma(
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, u_i, u_i_dot, a_j, a_j_dot, b_j, b_j_dot,
        w_i, w_j, radius, sense,
    ):  # fmt: skip
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        along = offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j)
        e_dot = line_accelerations(u_i, b_j, u_i_dot, b_j_dot)[1]
        return along + sense * radius * dot(e_dot, sub(w_i, w_j))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Rack]
