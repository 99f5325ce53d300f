"""Spring and damper of the relative orientation of two bodies."""

from dap3d_core.interface import Body, Force, body, hookimpl, number, numbers
from dap3d_core.kernels import add, atan2, cross, dot, neg, scale, sqrt, sub, where

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class BallSpring(Force):
    """Spring and damper, in parallel, against any turn of body j relative to body i.

    phi, axis times angle in [0, pi], is the rotation vector that turns body j from the orientation
    p_i o p_c, where the spring has no moment, to its own:

        (q0, e) = p_j o conj(p_i o p_c), q0 >= 0,  phi = 2 atan2(|e|, q0) e / |e|
        M = k phi + c (w_j - w_i), moment M on body i and -M on body j
        energy = k |phi|^2 / 2

    Half a turn away the moment of the spring jumps to the opposite direction.
    """

    keyword = "sph_sd"
    symbol = "ball"
    body_i: Body = body(doc="body from which the turn is measured")
    body_j: Body = body(doc="body that turns")
    k: float = number(default=0.0, unit="N m/rad", usual=(0.0, None), doc="stiffness")
    c: float = number(default=0.0, unit="N m s/rad", usual=(0.0, None), doc="damping coefficient")
    p_c: tuple = numbers(
        4, (1.0, 0.0, 0.0, 0.0), doc="orientation of body j in body i without moment, scaled to 1"
    )

    def prepare(self, bodies):
        size = sqrt(sum(x * x for x in self.p_c))
        if not size > 0.0:
            raise ValueError("p_c is zero; give the Euler parameters of a rotation")
        return {"p_c": tuple(x / size for x in self.p_c)}

    def wrench(p_i, p_j, p_c, w_i, w_j, k, c):
        M = add(scale(k, rotation_vector(p_i, p_j, p_c)), scale(c, sub(w_j, w_i)))
        return (ZERO, M), (ZERO, neg(M))

    def energy(p_i, p_j, p_c, k):
        phi = rotation_vector(p_i, p_j, p_c)
        return 0.5 * k * dot(phi, phi)


def rotation_vector(p_i, p_j, p_c):
    """The vector of the turn from p_i o p_c to p_j."""
    rest = product(p_i, p_c)
    q0, *e = product(p_j, (rest[0], -rest[1], -rest[2], -rest[3]))
    sine = sqrt(dot(e, e) + 1e-300)  # so that the limit without a turn is found, and its slope
    half = atan2(sine, where(q0 < 0.0, -q0, q0))
    return scale(where(q0 < 0.0, -2.0, 2.0) * half / sine, e)


def product(a, b):
    """The quaternion product a o b."""
    u, v = a[1:], b[1:]
    return (a[0] * b[0] - dot(u, v), *add(add(scale(a[0], v), scale(b[0], u)), cross(u, v)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BallSpring]
