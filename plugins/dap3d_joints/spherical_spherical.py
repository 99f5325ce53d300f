"""Spherical-spherical joint: a massless link of constant length between two points."""

from dap3d_core.interface import Joint, Vector2, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, neg, norm2, row, sub

interface_version = 1


class SphericalSpherical(Joint):
    """The distance of P_i and P_j stays the length of a massless link (manual: ``sph-sph``).

    Spec 4.3. One row, with d the vector from P_i to P_j and l its length:

        C     = (d . d - l^2) / 2
        J_i   = [-d^T, -(s_i x d)^T],  J_j = [d^T, (s_j x d)^T]
        gamma = d . (w_i x s_i_dot - w_j x s_j_dot) - d_dot . d_dot

    lambda |d| is the force in the link, negative in tension.
    """

    keyword, rows = "sph-sph", 1
    symbol = "link"
    d: Vector2 = vector2(direction=True, doc="from the link's end on body i to its end on body j")
    length: float = number(
        default=None, unit="m", positive=True, doc="length of the link; left out, as at the start"
    )

    def prepare(self, bodies):
        if self.length is not None:
            return {}
        d = sub(bodies["j"].place(self.P_j), bodies["i"].place(self.P_i))
        if norm2(d) == 0.0:
            raise ValueError(
                "the two points of the link coincide, so its direction is undefined; "
                "give other points"
            )
        return {"length": norm2(d) ** 0.5}

    def C(d, length):
        return 0.5 * (dot(d, d) - length * length)

    def J(d, s_P_i, s_P_j):
        return row(neg(d), cross(d, s_P_i)), row(d, cross(s_P_j, d))

    def gamma(d, d_dot, w_i, w_j, s_P_i_dot, s_P_j_dot):
        return dot(d, sub(cross(w_i, s_P_i_dot), cross(w_j, s_P_j_dot))) - dot(d_dot, d_dot)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [SphericalSpherical]
