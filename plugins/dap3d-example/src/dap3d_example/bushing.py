"""Bushing: an elastic joint, stiff and damped in all six directions."""

from dap3d_core.interface import Force, Point, hookimpl, matrix, point, vec3
from dap3d_core.kernels import (
    add,
    atan2,
    cos,
    cross,
    dot,
    neg,
    norm2,
    rotate,
    scale,
    sin,
    sqrt,
    sub,
    where,
)

interface_version = 1

NONE = (0.0, 0.0, 0.0)
NO_MATRIX = (NONE, NONE, NONE)


class Bushing(Force):
    """Spring and damper between P_i and P_j against every displacement and every rotation.

    In the axes of body i: x is r_Pj - r_Pi, phi the rotation vector of body j against body i (its
    angle, at most half a turn, times its axis), zero in the poses as given; x_dot their rate as
    seen from body i, w the relative angular velocity. With symmetric K_t, K_r, C_t, C_r:

        energy = x . K_t x / 2 + x . K_tr phi + phi . K_r phi / 2
        F = K_t x + K_tr phi + C_t x_dot + C_tr w
        M = G (K_tr^T x + K_r phi) + C_tr^T x_dot + C_r w

    F acts on body i and -F on body j, both at P_j; M on body i and -M on body j. For a small phi
    this is the 6 x 6 law that measurements give. G, by which M is the gradient of the energy for a
    large one, is the transposed inverse of the matrix that makes w of phi_dot:

        G mu = mu + phi x mu / 2 + g phi x (phi x mu),  g = (1 - a cot a) / |phi|^2,  a = |phi| / 2
    """

    keyword = "bushing"
    P_i: Point = point(doc="where it is fastened, on body i")
    P_j: Point = point(doc="where it is fastened, on body j; at rest there, where P_i is")
    k_t: tuple = vec3(NONE, unit="N/m", doc="diagonal of K_t: xx, yy, zz")
    k_r: tuple = vec3(NONE, unit="N m/rad", doc="diagonal of K_r")
    k_t_off: tuple = vec3(NONE, unit="N/m", doc="the rest of K_t: yz, zx, xy")
    k_r_off: tuple = vec3(NONE, unit="N m/rad", doc="the rest of K_r: yz, zx, xy")
    K_tr: tuple = matrix(NO_MATRIX, unit="N/rad", doc="force for a rotation, moment for a shift")
    c_t: tuple = vec3(NONE, unit="N s/m", doc="diagonal of C_t")
    c_r: tuple = vec3(NONE, unit="N m s/rad", doc="diagonal of C_r")
    c_t_off: tuple = vec3(NONE, unit="N s/m", doc="the rest of C_t: yz, zx, xy")
    c_r_off: tuple = vec3(NONE, unit="N m s/rad", doc="the rest of C_r: yz, zx, xy")
    C_tr: tuple = matrix(NO_MATRIX, unit="N s/rad", doc="force for a turning, moment for a speed")

    def prepare(self, bodies):
        return {
            "K_t": symmetric(self.k_t, self.k_t_off),
            "K_r": symmetric(self.k_r, self.k_r_off),
            "C_t": symmetric(self.c_t, self.c_t_off),
            "C_r": symmetric(self.c_r, self.c_r_off),
            "home": product(conjugate(bodies["i"].p), bodies["j"].p),
        }

    def wrench(
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i, s_P_j, A_i, p_i, p_j, w_i, w_j,
        home, K_t, K_r, K_tr, C_t, C_r, C_tr,
    ):  # fmt: skip
        d = sub(r_P_j, r_P_i)
        x, phi = back(A_i, d), rotation_vector(p_i, p_j, home)
        x_dot = back(A_i, sub(sub(v_P_j, v_P_i), cross(w_i, d)))
        w = back(A_i, sub(w_j, w_i))
        mu = add(back(K_tr, x), rotate(K_r, phi))
        F = add(rotate(K_t, x), rotate(K_tr, phi))
        F = rotate(A_i, add(F, add(rotate(C_t, x_dot), rotate(C_tr, w))))
        damping = add(back(C_tr, x_dot), rotate(C_r, w))
        M = rotate(A_i, add(gradient(phi, mu), damping))
        return (F, add(M, cross(add(s_P_i, d), F))), (neg(F), neg(add(M, cross(s_P_j, F))))

    def energy(r_P_i, r_P_j, A_i, p_i, p_j, home, K_t, K_r, K_tr):
        x, phi = back(A_i, sub(r_P_j, r_P_i)), rotation_vector(p_i, p_j, home)
        of_both = dot(x, rotate(K_tr, phi))
        return 0.5 * dot(x, rotate(K_t, x)) + of_both + 0.5 * dot(phi, rotate(K_r, phi))


def symmetric(diagonal, off):
    """The symmetric matrix with xx, yy, zz and yz, zx, xy."""
    (xx, yy, zz), (yz, zx, xy) = diagonal, off
    return ((xx, xy, zx), (xy, yy, yz), (zx, yz, zz))


def back(A, v):
    """A^T v."""
    return add(add(scale(v[0], A[0]), scale(v[1], A[1])), scale(v[2], A[2]))


def product(a, b):
    """The quaternion product of two 4-tuples."""
    u, v = (a[1], a[2], a[3]), (b[1], b[2], b[3])
    e = add(add(scale(a[0], v), scale(b[0], u)), cross(u, v))
    return (a[0] * b[0] - dot(u, v), e[0], e[1], e[2])


def conjugate(a):
    """The conjugate of a quaternion."""
    return (a[0], -a[1], -a[2], -a[3])


def rotation_vector(p_i, p_j, home):
    """phi, in the axes of body i, of the rotation that body j has made since it was at home."""
    q = product(product(conjugate(p_i), p_j), conjugate(home))
    sign = where(q[0] < 0.0, -1.0, 1.0)
    e = scale(sign, (q[1], q[2], q[3]))
    square = norm2(e)
    small = square < 1e-4
    sine = sqrt(where(small, 1.0, square))
    series = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0)))
    return scale(where(small, series, 2.0 * atan2(sine, sign * q[0]) / sine), e)


def gradient(phi, mu):
    """G mu: the moment whose power is mu . phi_dot."""
    square = norm2(phi)
    small = square < 1e-2
    angle = sqrt(where(small, 1.0, square))
    series = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    exact = (1.0 - 0.5 * angle * cos(0.5 * angle) / sin(0.5 * angle)) / (angle * angle)
    across = cross(phi, mu)
    return add(add(mu, scale(0.5, across)), scale(where(small, series, exact), cross(phi, across)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Bushing]
