"""Screw joint: a nut that advances along an axis as it turns about it."""

from math import pi

from dap3d_core.interface import Joint, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import dot, normals, sub
from dap3d_example.turning import references, turned_by, wrapped

interface_version = 1


class Screw(Joint):
    """Body i, the nut, moves along the axis a_j of body j by ``pitch`` a turn; one freedom is left.

    With d = r_Pi - r_Pj, x = a_j . d, n_j and m_j normal to a_j, theta the angle of body i against
    body j about a_j, and x_0 the value of x in the poses as given, where theta = 0:

        C = (n_j . d,  m_j . d,  a_i . n_j,  a_i . m_j,
             pitch / (2 pi) wrapped(2 pi (x - x_0) / pitch - theta))

    x itself says how often the nut has turned, so no turns need be counted: what is wrapped into
    (-pi, pi] is the error alone. J and gamma are derived from C.
    """

    keyword, rows = "screw", 5
    P_i: Point = point(doc="point on the axis, on the nut")
    P_j: Point = point(doc="point on the axis, on the screw")
    a_i: Vector = vector(doc="axis on the nut")
    a_j: Vector = vector(doc="axis on the screw; x grows along it")
    pitch: float = number(unit="m", doc="advance in one turn; negative for a left-handed thread")

    def prepare(self, bodies):
        if self.pitch == 0.0:
            raise ValueError("pitch is zero; a nut that does not advance is a revolute joint, rev")
        nut, screw = bodies["i"], bodies["j"]
        n, m = normals(self.a_j)
        e, f, u = references(self.a_i, nut, screw)
        d = sub(nut.place(self.P_i), screw.place(self.P_j))
        x_0 = dot(screw.to_global(self.a_j), d)
        return {"n_j": n, "m_j": m, "e_i": e, "f_i": f, "u_j": u, "x_0": x_0}

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j, e_i, f_i, u_j, x_0, pitch):
        d = sub(r_P_i, r_P_j)
        error = 2.0 * pi * (dot(a_j, d) - x_0) / pitch - turned_by(e_i, f_i, u_j)
        return (
            dot(n_j, d),
            dot(m_j, d),
            dot(a_i, n_j),
            dot(a_i, m_j),
            pitch / (2.0 * pi) * wrapped(error),
        )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Screw]
