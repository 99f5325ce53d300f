"""Joint types that their authors write as C alone, of motions that no standard type has."""

from dap3d_core.interface import Joint, Point, Vector, number, point, vector
from dap3d_core.kernels import dot, normals, sub


class Between(Joint):
    """Points on both bodies, an axis on each, and the normals of the one on body j."""

    P_i: Point = point(doc="point on body i")
    P_j: Point = point(doc="point on body j")
    a_i: Vector = vector(doc="axis on body i")
    a_j: Vector = vector(doc="axis on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}


class PinInSlot(Between):
    """A pin a_i of body i in a slot along a_j of body j; the pin keeps the direction m_j."""

    keyword, rows = "pin-in-slot", 4

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(d, n_j), dot(d, m_j), dot(a_i, a_j), dot(a_i, n_j)


class TwoHinges(Between):
    """A massless link of length 0.7 m between two hinges with parallel axes."""

    keyword, rows = "two-hinges", 4

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(d, a_j), 0.5 * (dot(d, d) - 0.49), dot(a_i, n_j), dot(a_i, m_j)


class Sleeve(Between):
    """A pin a_i of body i across a straight sleeve of body j, in which it slides and turns."""

    keyword, rows = "sleeve", 3

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(d, n_j), dot(d, m_j), dot(a_i, a_j)


class Trolley(Between):
    """As a sleeve, but a_i across n_j: a pin between the two bodies turns, and slides along a_j."""

    keyword, rows = "trolley", 3

    def C(r_P_i, r_P_j, a_i, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(d, n_j), dot(d, m_j), dot(a_i, n_j)


class Parabola(Between):
    """P_i runs along a parabola of body j, b_i across its plane: no motion about constant axes."""

    keyword, rows = "parabola", 5
    b_i: Vector = vector(doc="second axis on body i")

    def C(r_P_i, r_P_j, a_i, b_i, a_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        x = dot(d, a_j)
        return dot(d, n_j), dot(d, m_j) - 0.5 * x * x, dot(a_i, n_j), dot(a_i, m_j), dot(b_i, n_j)


class RepeatedRow(Between):
    """A spherical joint and the sum of its rows."""

    keyword, rows = "repeated-row", 4

    def C(r_P_i, r_P_j):
        x, y, z = sub(r_P_i, r_P_j)
        return x, y, z, x + y + z


class Upright(Between):
    """Axis a_i stays vertical and P_i at the height of P_j, wherever body j leans."""

    keyword, rows, ground_axes = "upright", 3, True

    def C(r_P_i, r_P_j, a_i):
        return a_i[0], a_i[1], r_P_i[2] - r_P_j[2]


class Rising(Between):
    """A spherical joint whose point rises at a constant speed."""

    keyword, rows = "rising", 3
    speed: float = number(default=0.1, unit="m/s", doc="speed along z of ground")

    def C(r_P_i, r_P_j, speed, t):
        x, y, z = sub(r_P_i, r_P_j)
        return x, y, z - speed * t


class OnGround(Joint):
    """A hinge at the origin of ground about its z axis, by rows of one body."""

    keyword, rows = "on-ground", 5
    P_i: Point = point(doc="point on the axis")
    a_i: Vector = vector(doc="axis")

    def C(r_P_i, a_i):
        return *r_P_i, a_i[0], a_i[1]


class Shelf(Joint):
    """A body slides along x of ground, its axes parallel to those of ground."""

    keyword, rows = "shelf", 5
    P_i: Point = point(doc="point on ground's x axis")

    def C(r_P_i, A_i):
        return r_P_i[1], r_P_i[2], A_i[0][1], A_i[1][2], A_i[2][0]
