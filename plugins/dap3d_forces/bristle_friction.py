"""LuGre friction along an axis."""

from dap3d_core.interface import Force, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import abs, add, cross, dot, exp, neg, scale, sub

interface_version = 1


class BristleFriction(Force):
    """Dry friction of a point P_i of body i that slides along the axis a_j of body j (LuGre).

    Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419. v is the
    velocity of P_i along a_j relative to body j, z the deflection of the bristles, a state:

        g = f_n (mu_c + (mu_s - mu_c) exp(-(v / v_s)^2))
        z_dot = v - sigma_0 |v| z / g
        F = sigma_0 z + sigma_1 z_dot + sigma_2 v,  -F a_j on body i at P_i, its opposite on body j

    It sticks, creeps before it slides, and lags behind the velocity, which a force that depends on
    the velocity alone does not. Bristles are stiff: integrator ``radau``, or ``auto``.
    """

    keyword = "lugre"
    states = ("z",)
    P_i: Point = point(doc="where body i slides")
    a_j: Vector = vector(doc="axis it slides along")
    f_n: float = number(unit="N", minimum=0.0, doc="normal force")
    mu_c: float = number(positive=True, doc="coefficient of friction while sliding")
    mu_s: float = number(positive=True, doc="coefficient of friction at rest")
    v_s: float = number(unit="m/s", positive=True, doc="Stribeck velocity")
    sigma_0: float = number(unit="N/m", positive=True, doc="stiffness of the bristles")
    sigma_1: float = number(0.0, unit="N s/m", minimum=0.0, doc="damping of the bristles")
    sigma_2: float = number(0.0, unit="N s/m", minimum=0.0, doc="viscous friction")
    z_0: float = number(0.0, unit="m", doc="initial deflection")
    z_atol: float = number(1e-13, unit="m", minimum=0.0, doc="absolute tolerance of z")

    def rate(r_P_i, v_P_i, r_j, v_j, w_j, a_j, z, f_n, mu_c, mu_s, v_s, sigma_0):
        v = sliding(r_P_i, v_P_i, r_j, v_j, w_j, a_j)
        return deflecting(v, z, f_n, mu_c, mu_s, v_s, sigma_0)

    def wrench(r_P_i, s_P_i, v_P_i, r_j, v_j, w_j, a_j, z, f_n, mu_c, mu_s, v_s, sigma_0, sigma_1,
               sigma_2):  # fmt: skip
        v = sliding(r_P_i, v_P_i, r_j, v_j, w_j, a_j)
        z_dot = deflecting(v, z, f_n, mu_c, mu_s, v_s, sigma_0)
        F = scale(-(sigma_0 * z + sigma_1 * z_dot + sigma_2 * v), a_j)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(sub(r_P_i, r_j), F)))


def sliding(r_P_i, v_P_i, r_j, v_j, w_j, a_j):
    """Velocity of P_i along the axis, relative to body j."""
    return dot(a_j, sub(v_P_i, add(v_j, cross(w_j, sub(r_P_i, r_j)))))


def deflecting(v, z, f_n, mu_c, mu_s, v_s, sigma_0):
    """z_dot; without a normal force the bristles follow."""
    g = f_n * (mu_c + (mu_s - mu_c) * exp(-(v / v_s) * (v / v_s)))
    return v - sigma_0 * abs(v) * z / (g + 1e-300)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BristleFriction]
