"""Spherical-spherical joint: a massless link of given length between two points."""

from dap3d_core.interface import Joint, Vector2, function, hookimpl, input_, number, vector2
from dap3d_core.kernels import abs, cross, dot, neg, norm2, row, sqrt, sub, where

interface_version = 1


class SphericalSpherical(Joint):
    """The distance of P_i and P_j stays the length of a massless link (manual: ``sph-sph``).

    With a function of time it is a driven leg, without mass: l = length + f, and a growing f
    increases the length. One row, with d the vector from P_i to P_j and l its
    length:

        C     = (d . d - l^2) / 2
        J_i   = [-d^T, -(s_i x d)^T],  J_j = [d^T, (s_j x d)^T]
        gamma = d . (w_i x s_i_dot - w_j x s_j_dot) - d_dot . d_dot

    lambda |d| is the force in the link, negative in tension, also with a function. An input
    is the speed at which the leg becomes longer, held between settings: the row is then
    one of the velocity level alone, and velocities jump where it is set.
    """

    keyword, rows = "sph-sph", 1
    synonyms = ("distance", "rod", "link")
    symbol = "link"
    d: Vector2 = vector2(direction=True, doc="from the link's end on body i to its end on body j")
    length: float = number(
        default=None, unit="m", positive=True, doc="length of the link; left out, as at the start"
    )
    function: str = function(doc="m, by which a driven leg is longer, as a function of time")
    input: str = input_(
        instead_of="function", unit="m/s", doc="speed at which a driven leg becomes longer"
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


class Leg(SphericalSpherical, function=True):
    """A driven leg: the length is l = length + f(t), or where it is left out l(0) + f(t) - f(0).

    The row is that of the link, so that lambda |d| is the force of the leg, negative in tension:

        C     = (d . d - l |l|) / 2,  nu = |l| f_dot
        gamma = d . (w_i x s_i_dot - w_j x s_j_dot) - d_dot . d_dot + |l| f_ddot + sign(l) f_dot^2

    A leg is not turned round: a run ends where l becomes negative.
    """

    drives = True
    switch_words = "the length of a driven leg has become zero; give it a greater length or stroke"

    def prepare(self, bodies):
        constants = super().prepare(bodies)
        return {"length": self.length, **constants, "counted": 1.0 if constants else 0.0}

    def C(d, length, counted, f, f_0):
        l = length + f - counted * f_0
        return 0.5 * (dot(d, d) - l * abs(l))

    def nu(length, counted, f, f_0, f_dot):
        return abs(length + f - counted * f_0) * f_dot

    def gamma(d, d_dot, w_i, w_j, s_P_i_dot, s_P_j_dot, length, counted, f, f_0, f_dot, f_ddot):
        l = length + f - counted * f_0
        arms = dot(d, sub(cross(w_i, s_P_i_dot), cross(w_j, s_P_j_dot)))
        driven = abs(l) * f_ddot + where(l < 0.0, -1.0, 1.0) * f_dot * f_dot
        return arms - dot(d_dot, d_dot) + driven

    def switch(length, counted, f, f_0):
        return length + f - counted * f_0


class Paced(SphericalSpherical, input=True):
    """A leg whose speed is an input v: nu = |d| v, gamma as for the link, and v d . d_dot / |d|."""

    drives, holonomic = True, False
    C = None

    def nu(d, input):
        return sqrt(norm2(d)) * input

    def gamma(d, d_dot, w_i, w_j, s_P_i_dot, s_P_j_dot, input):
        arms = dot(d, sub(cross(w_i, s_P_i_dot), cross(w_j, s_P_j_dot)))
        return arms - dot(d_dot, d_dot) + input * dot(d, d_dot) / sqrt(norm2(d))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [SphericalSpherical]
