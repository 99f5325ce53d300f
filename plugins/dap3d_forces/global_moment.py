"""Constant moment in ground axes."""

from dap3d_core.interface import Body, Force, body, hookimpl, vec3

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class GlobalMoment(Force):
    """A moment n on body i, constant in ground axes (manual: ``n``; spec 6)."""

    keyword = "n"
    actuates = "n"
    body_i: Body = body(doc="the body it acts on")
    n: tuple = vec3(unit="N m", doc="components in ground axes")

    def wrench(n):
        return ((ZERO, n),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GlobalMoment]
