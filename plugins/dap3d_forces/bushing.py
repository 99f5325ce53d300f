"""Bushing: an elastic joint, stiff and damped in all six directions."""

from dap3d_core.interface import Force, Point, hookimpl, point, square
from dap3d_core.kernels import (
    add,
    atan2,
    conjugate,
    cross,
    dot,
    neg,
    norm2,
    quaternion_product,
    rotate,
    rotation_vector,
    scale,
    sqrt,
    sub,
    transpose,
    where,
)

interface_version = 1

NONE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Bushing(Force):
    """Spring and damper between P_i and P_j against every displacement and every rotation.

    k and c are 6 numbers, along x, y, z and about x, y, z of body i, or whole 6 x 6 matrices with
    the blocks K_t, K_tr, K_r. In the axes of body i: x is r_Pj - r_Pi, phi the rotation vector of
    body j against body i (its angle, at most half a turn, times its axis), zero in the poses as
    given; x_dot their rate as seen from body i, w the relative angular velocity:

        energy = x . K_t x / 2 + x . K_tr phi + phi . K_r phi / 2
        F = K_t x + K_tr phi + C_t x_dot + C_tr w
        M = G (K_tr^T x + K_r phi) + C_tr^T x_dot + C_r w

    F acts on body i and -F on body j, both at P_j; M on body i and -M on body j. For a small phi
    this is the 6 x 6 law that measurements give. G, by which M is the gradient of the energy for a
    large one, is the transposed inverse of the matrix that makes w of phi_dot:

        G mu = mu + phi x mu / 2 + g phi x (phi x mu),  g = (1 - a cot a) / |phi|^2,  a = |phi| / 2
    """

    keyword = "bushing"
    body_axes = ("i",)
    synonyms = ("mount",)
    symbol = "ball"
    P_i: Point = point(doc="where it is fastened, on body i")
    P_j: Point = point(doc="where it is fastened, on body j; at rest there, where P_i is")
    k: tuple = square(6, NONE, doc="stiffness, N/m and N m/rad (between them: N/rad)")
    c: tuple = square(6, NONE, doc="damping, N s/m and N m s/rad (between them: N s/rad)")

    def prepare(self, bodies):
        K_t, K_tr, K_r = blocks(self.k)
        C_t, C_tr, C_r = blocks(self.c)
        home = quaternion_product(conjugate(bodies["i"].p), bodies["j"].p)
        return {
            "K_t": K_t, "K_tr": K_tr, "K_r": K_r, "C_t": C_t, "C_tr": C_tr, "C_r": C_r, "home": home
        }  # fmt: skip

    def wrench(
        r_P_i, r_P_j, v_P_j, v_i, s_P_i, s_P_j, A_i, p_i, p_j, w_i, w_j,
        home, K_t, K_tr, K_r, C_t, C_tr, C_r,
    ):  # fmt: skip
        d, to_i = sub(r_P_j, r_P_i), transpose(A_i)
        x, arm = rotate(to_i, d), add(s_P_i, d)
        e, f, h = turning(turned(p_i, p_j, home))
        x_dot = rotate(to_i, sub(v_P_j, add(v_i, cross(w_i, arm))))
        w = rotate(to_i, sub(w_j, w_i))
        mu = add(rotate(transpose(K_tr), x), scale(f, rotate(K_r, e)))
        F = add(rotate(K_t, x), scale(f, rotate(K_tr, e)))
        F = rotate(A_i, add(F, add(rotate(C_t, x_dot), rotate(C_tr, w))))
        damping = add(rotate(transpose(C_tr), x_dot), rotate(C_r, w))
        bent = cross(e, add(scale(0.5 * f, mu), scale(h, cross(e, mu))))
        M = rotate(A_i, add(add(mu, damping), bent))
        return (F, add(M, cross(arm, F))), (neg(F), neg(add(M, cross(s_P_j, F))))

    def energy(r_P_i, r_P_j, A_i, p_i, p_j, home, K_t, K_tr, K_r):
        x, phi = rotate(transpose(A_i), sub(r_P_j, r_P_i)), turn(p_i, p_j, home)
        of_both = dot(x, rotate(K_tr, phi))
        return 0.5 * dot(x, rotate(K_t, x)) + of_both + 0.5 * dot(phi, rotate(K_r, phi))

    def switch(p_i, p_j, home):
        return turned(p_i, p_j, home)[0]  # zero at half a turn, where phi jumps


def blocks(given):
    """The 3 x 3 blocks of translation, of both, and of rotation of a symmetric 6 x 6 matrix."""
    if not isinstance(given[0], tuple):
        given = [[value if m == n else 0.0 for n in range(6)] for m, value in enumerate(given)]
    places = ((0, 0), (0, 3), (3, 3))
    return (tuple(tuple(given[m + k][n : n + 3]) for k in range(3)) for m, n in places)


def turn(p_i, p_j, home):
    """phi, in the axes of body i, of the rotation that body j has made since it was at home."""
    return rotation_vector(turned(p_i, p_j, home))


def turned(p_i, p_j, home):
    """The same rotation as Euler parameters."""
    return quaternion_product(quaternion_product(conjugate(p_i), p_j), conjugate(home))


def turning(q):
    """E, f, h of Euler parameters q, with e the sine of a along the axis.

    phi = f e, and G mu = mu + f e x mu / 2 + h e x (e x mu).
    """
    e = (q[1], q[2], q[3])
    square, sense = norm2(e), where(q[0] < 0.0, -1.0, 1.0)
    small = square < 1e-4  # where what is left of the series is below 1e-17
    squared = where(small, 1.0, square)
    sine, inverse = sqrt(squared), 1.0 / squared
    half = atan2(sine, sense * q[0])
    f = sense * (2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0))))
    h = 1.0 / 3.0 + square * (2.0 / 15.0 + square * (8.0 / 105.0 + square * (16.0 / 315.0)))
    exact = half * (2.0 * sense * sine * inverse)
    return e, where(small, f, exact), where(small, h, (1.0 - 0.5 * q[0] * exact) * inverse)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Bushing]
