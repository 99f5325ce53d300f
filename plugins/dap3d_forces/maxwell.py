"""Maxwell element: spring and damper in series, with a spring beside them."""

from dap3d_core.interface import Force, Vector2, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, neg, scale, sqrt

interface_version = 1


class Maxwell(Force):
    """Spring and damper in series on the line from P_i to P_j, and a second spring beside them.

    With l = ``|d|``, x = l - l0 and the elongation z of the damper, a state, tension is positive:

        z_dot = k (x - z) / c
        F = k (x - z) + k_p x,  on body i towards P_j, its opposite on body j
        energy = k (x - z)^2 / 2 + k_p x^2 / 2

    A fast motion meets the stiffness k + k_p, a slow one k_p alone; between them, about the rate
    k / c, the damper takes energy. With k_p it is the standard linear solid (Zener).
    """

    keyword = "maxwell"
    states = ("z",)
    d: Vector2 = vector2(direction=True, doc="from the end on body i to the end on body j")
    k: float = number(unit="N/m", positive=True, doc="stiffness of the spring in series")
    c: float = number(unit="N s/m", positive=True, doc="damping coefficient")
    k_p: float = number(0.0, unit="N/m", usual=(0.0, None), doc="stiffness of the spring beside")
    l0: float = number(0.0, unit="m", minimum=0.0, doc="undeformed length")
    z_0: float = number(0.0, unit="m", doc="initial elongation of the damper")

    def rate(d, z, k, c, l0):
        return k / c * (sqrt(dot(d, d)) - l0 - z)

    def wrench(d, z, s_P_i, s_P_j, k, k_p, l0):
        length = sqrt(dot(d, d))
        x = length - l0
        F = scale((k * (x - z) + k_p * x) / length, d)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(s_P_j, F)))

    def energy(d, z, k, k_p, l0):
        x = sqrt(dot(d, d)) - l0
        return 0.5 * (k * (x - z) * (x - z) + k_p * x * x)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Maxwell]
