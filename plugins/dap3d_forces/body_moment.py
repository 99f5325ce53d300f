"""Constant moment in body axes."""

from dap3d_core.interface import Body, Force, body, hookimpl, vec3
from dap3d_core.kernels import rotate

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class BodyMoment(Force):
    """A moment A_i np on body i, constant in its axes (manual: ``np``; spec 6)."""

    keyword = "np"
    actuates = "np"
    body_i: Body = body(doc="the body it acts on")
    np: tuple = vec3(unit="N m", doc="components in body axes")

    def wrench(A_i, np):
        return ((ZERO, rotate(A_i, np)),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BodyMoment]
