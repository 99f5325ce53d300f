"""Hydraulic cylinder."""

from dap3d_core.interface import Force, Vector2, function, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, scale, sqrt

interface_version = 1


class Cylinder(Force):
    """A hydraulic cylinder from P_i to P_j, with the pressures of both chambers as states.

    With the stroke s = ``|d|`` - l_min and its rate v, a valve that lets f(t) m^3/s into chamber a
    and as much out of chamber b, and leakage past the piston:

        q = f - leak (p_a - p_b)
        p_a_dot = bulk (q - area_a v) / (dead + area_a s)
        p_b_dot = bulk (area_b v - q) / (dead + area_b (stroke - s))
        F = area_a p_a - area_b p_b,  it pushes the two points apart
    """

    keyword = "cylinder"
    states = ("p_a", "p_b")
    d: Vector2 = vector2(direction=True, doc="from the end on body i to the end on body j")
    area_a: float = number(unit="m^2", positive=True, doc="piston area of chamber a")
    area_b: float = number(unit="m^2", positive=True, doc="of chamber b, less the rod")
    l_min: float = number(unit="m", positive=True, doc="length without stroke")
    stroke: float = number(unit="m", positive=True, doc="longest stroke")
    bulk: float = number(1.4e9, unit="Pa", positive=True, doc="bulk modulus of the oil")
    dead: float = number(1e-5, unit="m^3", positive=True, doc="dead volume of each chamber")
    leak: float = number(0.0, unit="m^3/(s Pa)", minimum=0.0, doc="leakage past the piston")
    function: str = function(doc="volume flow of the valve, m^3/s, of time")
    p_a_0: float = number(0.0, unit="Pa", doc="initial pressure of chamber a")
    p_b_0: float = number(0.0, unit="Pa", doc="initial pressure of chamber b")
    p_a_atol: float = number(1e-4, unit="Pa", minimum=0.0, doc="absolute tolerance of p_a")
    p_b_atol: float = number(1e-4, unit="Pa", minimum=0.0, doc="absolute tolerance of p_b")

    def rate(d, d_dot, p_a, p_b, f, area_a, area_b, l_min, stroke, bulk, dead, leak):
        length = sqrt(dot(d, d))
        s, v, q = length - l_min, dot(d, d_dot) / length, f - leak * (p_a - p_b)
        of_a = bulk * (q - area_a * v) / (dead + area_a * s)
        of_b = bulk * (area_b * v - q) / (dead + area_b * (stroke - s))
        return of_a, of_b

    def wrench(d, p_a, p_b, s_P_i, s_P_j, area_a, area_b):
        F = scale((area_a * p_a - area_b * p_b) / sqrt(dot(d, d)), d)
        back = scale(-1.0, F)
        return (back, cross(s_P_i, back)), (F, cross(s_P_j, F))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Cylinder]
