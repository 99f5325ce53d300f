"""Harmonic function."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import cos, sin

interface_version = 1


class Harmonic(Function):
    """f = offset + amplitude sin(frequency x + phase); the frequency is an angular one."""

    keyword, smooth = "harmonic", True
    synonyms = ("sine", "sin", "cosine")
    amplitude: float = number(default=1.0, doc="amplitude")
    frequency: float = number(unit="rad/s", doc="angular frequency")
    phase: float = number(default=0.0, unit="rad", doc="phase at x = 0")
    offset: float = number(default=0.0, doc="mean value")

    def value(x, amplitude, frequency, phase, offset):
        s, c = amplitude * sin(frequency * x + phase), amplitude * cos(frequency * x + phase)
        square = frequency * frequency
        return offset + s, frequency * c, -square * s, -square * frequency * c


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Harmonic]
