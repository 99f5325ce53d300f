"""Bouc-Wen element: a spring with hysteresis."""

from dap3d_core.interface import Force, Vector2, hookimpl, number, vector2
from dap3d_core.kernels import abs, cross, dot, neg, scale, sqrt, where

interface_version = 1


class Hysteresis(Force):
    """Hysteretic spring on the line from P_i to P_j (Bouc, Wen).

    Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249. With l = ``|d|``, x = l - l0, v = l_dot and the
    hysteretic elongation z, a state, tension is positive:

        z_dot = v - beta |v| |z|^(n - 1) z - gamma v |z|^n
        F = alpha k x + (1 - alpha) k z,  on body i towards P_j, its opposite on body j

    z stays within (beta + gamma)^(-1/n), the yield elongation, and follows x far below it. alpha is
    the stiffness after yield as a part of k; n makes the transition sharper.
    """

    keyword = "bouc-wen"
    states = ("z",)
    d: Vector2 = vector2(direction=True, doc="from the end on body i to the end on body j")
    k: float = number(unit="N/m", positive=True, doc="initial stiffness")
    alpha: float = number(
        0.0, minimum=0.0, maximum=1.0, doc="stiffness after yield, as a part of k"
    )
    beta: float = number(unit="m^-n", positive=True, doc="width of the loop")
    gamma: float = number(unit="m^-n", doc="form of the loop, between -beta and beta")
    n: float = number(1.0, minimum=1.0, doc="sharpness of the yield")
    l0: float = number(0.0, unit="m", minimum=0.0, doc="undeformed length")
    z_0: float = number(0.0, unit="m", doc="initial hysteretic elongation")

    def rate(d, d_dot, z, beta, gamma, n):
        v, sign = dot(d, d_dot) / sqrt(dot(d, d)), where(z < 0.0, -1.0, 1.0)
        return v - abs(z) ** n * (beta * abs(v) * sign + gamma * v)

    def wrench(d, z, s_P_i, s_P_j, k, alpha, l0):
        length = sqrt(dot(d, d))
        F = scale(k * (alpha * (length - l0) + (1.0 - alpha) * z) / length, d)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(s_P_j, F)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Hysteresis]
