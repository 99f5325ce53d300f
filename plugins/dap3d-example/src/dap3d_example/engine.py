"""Engine with a map of its torque."""

from dap3d_core.interface import (
    REQUIRED,
    Body,
    Force,
    Vector,
    body,
    function,
    hookimpl,
    input_,
    vector,
)
from dap3d_core.kernels import dot, neg, scale, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Engine(Force):
    """A torque on body i about the axis a_j of body j, by a map over speed and throttle.

        omega = a_j . (w_i - w_j)
        T = f(omega, throttle),  moment T a_j on body i, its opposite on body j

    f is a function of two arguments, ``grid`` of measured points, say; the throttle an input, which
    a controller or a script sets.
    """

    keyword = "engine"
    body_i: Body = body(doc="the crankshaft")
    a_j: Vector = vector(doc="axis, on the body that holds the engine")
    throttle: str = input_(REQUIRED, doc="throttle")
    function: str = function(
        REQUIRED, argument=("speed, rad/s,", "throttle"), doc="the torque, N m"
    )

    def wrench(w_i, w_j, a_j, f, throttle):
        moment = scale(f(dot(a_j, sub(w_i, w_j)), throttle), a_j)
        return (ZERO, moment), (ZERO, neg(moment))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Engine]
