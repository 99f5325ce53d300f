"""Bushing: an elastic joint, stiff and damped in all six directions."""

from dap3d_core.interface import Force, Point, hookimpl, point, square
from dap3d_core.kernels import abs as magnitude
from dap3d_core.kernels import (
    add,
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
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i, s_P_j, A_i, p_i, p_j, w_i, w_j,
        home, K_t, K_tr, K_r, C_t, C_tr, C_r,
    ):  # fmt: skip
        d, to_i = sub(r_P_j, r_P_i), transpose(A_i)
        x, q = rotate(to_i, d), turned(p_i, p_j, home)
        phi = rotation_vector(q)
        x_dot = rotate(to_i, sub(sub(v_P_j, v_P_i), cross(w_i, d)))
        w = rotate(to_i, sub(w_j, w_i))
        mu = add(rotate(transpose(K_tr), x), rotate(K_r, phi))
        F = add(rotate(K_t, x), rotate(K_tr, phi))
        F = rotate(A_i, add(F, add(rotate(C_t, x_dot), rotate(C_tr, w))))
        damping = add(rotate(transpose(C_tr), x_dot), rotate(C_r, w))
        M = rotate(A_i, add(gradient(q, phi, mu), damping))
        return (F, add(M, cross(add(s_P_i, d), F))), (neg(F), neg(add(M, cross(s_P_j, F))))

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


def gradient(q, phi, mu):
    """G mu: the moment whose power is mu . phi_dot; q are the Euler parameters of phi."""
    square = norm2(phi)
    small = square < 1e-2
    sine = norm2((q[1], q[2], q[3]))  # of half the angle, squared
    cot = magnitude(q[0]) / sqrt(where(small, 1.0, sine))
    series = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    squared = where(small, 1.0, square)
    exact = (1.0 - 0.5 * sqrt(squared) * cot) / squared
    across = cross(phi, mu)
    return add(add(mu, scale(0.5, across)), scale(where(small, series, exact), cross(phi, across)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Bushing]
