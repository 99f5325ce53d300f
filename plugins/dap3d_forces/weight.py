"""Weight: gravity on every body."""

from dap3d_core.interface import Force, hookimpl, number, vec3
from dap3d_core.kernels import dot, scale

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Weight(Force):
    """Every body is pulled along wgt by its mass times gravity (manual: ``weight``).

    On each body, at its mass centre:

        force = mass gravity wgt,  moment = 0,  energy = -mass gravity wgt . r
    """

    keyword, each_body = "weight", True
    synonyms = ("gravity",)
    gravity: float = number(
        default=9.81, unit="m/s^2", usual=(0.0, None), doc="gravitational acceleration"
    )
    wgt: tuple = vec3(
        default=(0.0, 0.0, -1.0),
        direction=True,
        in_ground=True,
        doc="direction of gravity, used as given",
    )

    def wrench(mass_i, gravity, wgt):
        return ((scale(mass_i * gravity, wgt), ZERO),)

    def energy(mass_i, gravity, wgt, r_i):
        return -mass_i * gravity * dot(wgt, r_i)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Weight]
