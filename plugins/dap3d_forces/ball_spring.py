"""Spring and damper of the relative orientation of two bodies."""

from dap3d_core.interface import Body, Force, body, hookimpl, number, numbers
from dap3d_core.kernels import (
    add,
    conjugate,
    dot,
    neg,
    quaternion_product,
    rotation_vector,
    scale,
    sqrt,
    sub,
)

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
        M = add(scale(k, turn(p_i, p_j, p_c)), scale(c, sub(w_j, w_i)))
        return (ZERO, M), (ZERO, neg(M))

    def energy(p_i, p_j, p_c, k):
        phi = turn(p_i, p_j, p_c)
        return 0.5 * k * dot(phi, phi)

    def switch(p_i, p_j, p_c):
        return turned(p_i, p_j, p_c)[0]  # zero at half a turn, where phi jumps


def turn(p_i, p_j, p_c):
    """phi, the rotation vector of the turn from p_i o p_c to p_j."""
    return rotation_vector(turned(p_i, p_j, p_c))


def turned(p_i, p_j, p_c):
    """The same turn as Euler parameters."""
    return quaternion_product(p_j, conjugate(quaternion_product(p_i, p_c)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BallSpring]
