"""Translational spring, damper and actuator along an axis."""

from dap3d_core.interface import (
    Force,
    Point,
    Vector,
    function,
    hookimpl,
    input_,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import cross, dot, neg, scale, sub

interface_version = 1


class AxialSpring(Force):
    """Spring, damper and actuator, in parallel, along the axis a_j of body j.

    A positive f_a increases x, and with it the length that a ``tran`` or ``cyl`` of the same bodies
    i and j reports. x is how far P_i lies beyond P_j along a_j, of any sign, and x_dot its rate as
    seen from body j. With d = r_Pi - r_Pj:

        x = a_j . d,  x_dot = a_j . (v_Pi - v_Pj - w_j x d)
        F = k (x - x_0) + c x_dot - f_a,  force -F a_j at P_i on body i, F a_j there on body j
        energy = k (x - x_0)^2 / 2 - f_a x

    What ``rot_sda`` is for hinges, for sliders. A function of x - x_0 takes the place of
    k (x - x_0), without an energy. An input multiplies f_a, which then counts as work.
    """

    keyword = "tran_sda"
    actuates = "f_a"
    joint: str = joint_fields(
        "P_i", "P_j", "a_j", acts_in="length",
        doc="the joint along which it acts; its length is 0 in the poses of the scene, x is not",
    )  # fmt: skip
    P_i: Point = point(doc="where the force acts, on body i")
    P_j: Point = point(doc="point from which x is measured, on body j")
    a_j: Vector = vector(doc="axis, on body j")
    k: float = number(default=0.0, unit="N/m", usual=(0.0, None), doc="stiffness")
    c: float = number(default=0.0, unit="N s/m", usual=(0.0, None), doc="damping coefficient")
    x_0: float = number(default=0.0, unit="m", doc="distance x without force of the spring")
    f_a: float = number(default=0.0, unit="N", doc="force of the actuator; x grows by it")
    input: str = input_(doc="factor of f_a, an input")
    function: str = function(argument="x - x_0", doc="force, N, in place of k (x - x_0)")

    def wrench(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j, s_P_i, r_j, k, c, x_0, f_a):
        x, x_dot = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(k * (x - x_0) + c * x_dot - f_a, a_j, s_P_i, r_P_i, r_j)

    def energy(a_j, r_P_i, r_P_j, k, x_0, f_a):
        x = dot(a_j, sub(r_P_i, r_P_j))
        return 0.5 * k * (x - x_0) * (x - x_0) - f_a * x


class Actuated(AxialSpring, function=False, input=True):
    """The actuator's force times an input."""

    energy_where = "without f_a"

    def wrench(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j, s_P_i, r_j, k, c, x_0, f_a, input):
        x, x_dot = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(k * (x - x_0) + c * x_dot - input * f_a, a_j, s_P_i, r_P_i, r_j)

    def energy(a_j, r_P_i, r_P_j, k, x_0):
        x = dot(a_j, sub(r_P_i, r_P_j)) - x_0
        return 0.5 * k * x * x


class Curve(AxialSpring, function=True, input=False):
    """The spring is a function of x - x_0."""

    energy = None

    def wrench(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j, s_P_i, r_j, c, x_0, f_a, f):
        x, x_dot = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(f(x - x_0) + c * x_dot - f_a, a_j, s_P_i, r_P_i, r_j)


class ActuatedCurve(AxialSpring, function=True, input=True):
    """A spring curve, and the actuator's force times an input."""

    energy = None

    def wrench(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j, s_P_i, r_j, c, x_0, f_a, f, input):
        x, x_dot = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(f(x - x_0) + c * x_dot - input * f_a, a_j, s_P_i, r_P_i, r_j)


def along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j):
    """How far P_i lies beyond P_j along the axis, and its rate as seen from body j."""
    d = sub(r_P_i, r_P_j)
    return dot(a_j, d), dot(a_j, sub(sub(v_P_i, v_P_j), cross(w_j, d)))


def pull(F, a_j, s_P_i, r_P_i, r_j):
    """The force -F along the axis on body i at P_i, and its opposite on body j there."""
    on_i = scale(-F, a_j)
    return (on_i, cross(s_P_i, on_i)), (neg(on_i), neg(cross(sub(r_P_i, r_j), on_i)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [AxialSpring]
