"""Point-to-point spring, damper and actuator."""

from dap3d_core.interface import Force, Vector2, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, neg, scale, sqrt

interface_version = 1


class PointToPoint(Force):
    """Spring, damper and actuator, in parallel, on the line from P_i to P_j (manual: ``ptp``).

    Spec 6. With l = |d|, u = d / l and l_dot = u . d_dot, tension positive:

        F = k (l - l0) + c l_dot + f_a,  force F u at P_i on body i and -F u at P_j on body j
        energy = k (l - l0)^2 / 2 + f_a l
    """

    keyword = "ptp"
    d: Vector2 = vector2(doc="from the end on body i to the end on body j")
    k: float = number(default=0.0, unit="N/m", doc="stiffness")
    c: float = number(default=0.0, unit="N s/m", doc="damping coefficient")
    l0: float = number(default=0.0, unit="m", minimum=0.0, doc="undeformed length")
    f_a: float = number(default=0.0, unit="N", doc="force of the actuator, tension positive")

    def wrench(d, d_dot, s_P_i, s_P_j, k, c, l0, f_a):
        length = sqrt(dot(d, d))
        u = scale(1.0 / length, d)
        F = scale(k * (length - l0) + c * dot(u, d_dot) + f_a, u)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(s_P_j, F)))

    def energy(d, k, l0, f_a):
        length = sqrt(dot(d, d))
        return 0.5 * k * (length - l0) * (length - l0) + f_a * length


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [PointToPoint]
