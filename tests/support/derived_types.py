"""Types that leave formulas to be derived, beside types that have them written by hand."""

from dap3d_core.interface import (
    REQUIRED,
    Body,
    Force,
    Function,
    Joint,
    Point,
    Vector,
    angle,
    body,
    function,
    number,
    point,
    vector,
    vector2,
)
from dap3d_core.kernels import add, cross, dot, norm2, normals, rotate, sin, sqrt, sub, where


def from_C_alone(type_, keyword):
    """A joint type without its own J, gamma and nu, under another keyword."""
    without = {"J": None, "gamma": None, "nu": None, "keyword": keyword}
    return type(f"Derived{type_.__name__}", (type_,), without)


class Rolling(Joint):
    """The disk that rolls without slip, by the velocity of the point that touches the ground."""

    keyword, rows, holonomic = "rolling", 3, (False, False, True)
    body_i: Body = body()
    radius: float = number(default=1.0, positive=True)

    def C(r_i, A_i, radius):
        return r_i[2] - radius * sqrt(1.0 - A_i[2][1] * A_i[2][1])

    def C_dot(A_i, v_i, w_i, radius):
        eta = (A_i[0][1], A_i[1][1], A_i[2][1])
        sigma = sqrt(1.0 - eta[2] * eta[2])
        c = radius * eta[2] / sigma
        v = add(v_i, cross(w_i, (c * eta[0], c * eta[1], -radius * sigma)))
        return v[0], v[1]


class Spindle(Joint):
    """Two bodies share an axis; they turn about it as they slide along it."""

    keyword, rows = "spindle", 5
    P_i: Point = point()
    P_j: Point = point()
    a_i: Vector = vector()
    a_j: Vector = vector()
    u_i: Vector = vector()
    pitch: float = number()

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(a_i, n_j, m_j, a_j, r_P_i, r_P_j, u_i, pitch):
        d = sub(r_P_j, r_P_i)
        turn = dot(u_i, m_j) / sqrt(dot(u_i, n_j) ** 2 + dot(u_i, m_j) ** 2)
        return dot(a_i, n_j), dot(a_i, m_j), dot(d, n_j), dot(d, m_j), dot(d, a_j) - pitch * turn


class Winding(Joint):
    """P_j moves along a_j as body i turns against body j; whole turns are counted."""

    keyword, rows = "winding", 1
    P_i: Point = point()
    P_j: Point = point()
    a_j: Vector = vector()
    pitch: float = number()
    theta: float = angle("u_i", "n_j", "a_j")

    def prepare(self, bodies):
        n, _ = normals(self.a_j)
        return {"n_j": n, "u_i": bodies["i"].to_local(bodies["j"].to_global(n))}

    def C(r_P_i, r_P_j, a_j, theta, pitch):
        return dot(a_j, sub(r_P_j, r_P_i)) - pitch * theta


class Spooling(Winding):
    """The same by speeds alone; theta_dot is k . (w_j - w_i), wherever the axes point."""

    keyword, holonomic, C = "spooling", False, None

    def C_dot(v_P_i, v_P_j, a_j, theta_dot, pitch):
        return dot(a_j, sub(v_P_j, v_P_i)) - pitch * theta_dot


class Cam(Joint):
    """P_j keeps a height over P_i along a_i that a function of the way along b_i gives."""

    keyword, rows = "cam", 1
    P_i: Point = point()
    P_j: Point = point()
    a_i: Vector = vector()
    b_i: Vector = vector()
    function: str = function(REQUIRED, argument="way")


class WithProfile(Cam, function=True):
    """With the function given."""

    def C(r_P_i, r_P_j, a_i, b_i, f):
        d = sub(r_P_j, r_P_i)
        return dot(d, a_i) - f(dot(d, b_i))


class Unsteady(Joint):
    """A distance that time prescribes twice: by the clock and by a function; with a branch."""

    keyword, rows = "unsteady", 1
    P_i: Point = point()
    P_j: Point = point()
    function: str = function()

    def C(t, f, f_0, r_P_i, r_P_j):
        square = norm2(sub(r_P_j, r_P_i))
        return where(square > 1e-3, square, 2.0 * square) - f * (f - f_0) - sin(3.0 * t) * abs(f)


class Elastic(Force):
    """A spring by its energy alone."""

    keyword = "elastic"
    d: str = vector2()
    k: float = number()
    length: float = number()

    def energy(d, k, length):
        return 0.5 * k * (sqrt(norm2(d)) - length) ** 2


class Anisotropic(Force):
    """A potential that grows with place and turn: of r, A and p."""

    keyword = "anisotropic"
    body_i: Body = body()
    k: float = number()

    def energy(r_i, A_i, p_i, k):
        up = rotate(A_i, (0.0, 0.0, 1.0))
        return k * (r_i[0] * up[1] + r_i[2] ** 2 * p_i[1] * p_i[0])


class Wave(Function):
    """A function by its value alone."""

    keyword = "wave"
    amplitude: float = number()
    rate: float = number()

    def value(x, amplitude, rate):
        return amplitude * sin(rate * x) / sqrt(1.0 + x * x)
