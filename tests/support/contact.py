"""Force types whose law has branches, each with its switch."""

from dap3d_core.interface import Body, Force, body, number
from dap3d_core.kernels import where
from support.own_types import registry_of


class Floor(Force):
    """A spring and a damper in z below z = 0; the contact may pull."""

    keyword = "test-floor"
    body_i: Body = body()
    k: float = number(default=1e4, unit="N/m", minimum=0.0)
    c: float = number(default=0.0, unit="N s/m", minimum=0.0)

    def wrench(r_i, v_i, k, c):
        return (((0.0, 0.0, where(r_i[2] < 0.0, -k * r_i[2] - c * v_i[2], 0.0)), (0.0, 0.0, 0.0)),)

    def switch(r_i):
        return r_i[2]


class Lid(Force):
    """A constant push downwards above a height: the force jumps."""

    keyword = "test-lid"
    body_i: Body = body()
    height: float = number()
    push: float = number(default=10.0)

    def wrench(r_i, height, push):
        return (((0.0, 0.0, where(r_i[2] > height, -push, 0.0)), (0.0, 0.0, 0.0)),)

    def switch(r_i, height):
        return height - r_i[2]


class Band(Force):
    """A constant push along x between two walls: a switch of two numbers."""

    keyword = "test-band"
    body_i: Body = body()
    low: float = number()
    high: float = number()

    def wrench(r_i, low, high):
        inside = where(r_i[0] > low, where(r_i[0] < high, 1.0, 0.0), 0.0)
        return (((inside, 0.0, 0.0), (0.0, 0.0, 0.0)),)

    def switch(r_i, low, high):
        return r_i[0] - low, r_i[0] - high


class Dry(Force):
    """Friction against the motion along x, without a transition: it cannot hold a body at rest."""

    keyword = "test-dry"
    body_i: Body = body()
    load: float = number(default=1.0)

    def wrench(v_i, load):
        return (((where(v_i[0] > 0.0, -load, load), 0.0, 0.0), (0.0, 0.0, 0.0)),)

    def switch(v_i):
        return v_i[0]


class Fuse(Force):
    """Does nothing, and ends the run where the body goes beyond a height."""

    keyword = "test-fuse"
    switch_words = "the body is too low"
    body_i: Body = body()
    height: float = number()

    def wrench():
        return (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),)

    def switch(r_i, height):
        return r_i[2] - height


def contact_registry():
    """The installed types and these."""
    return registry_of(Floor, Lid, Band, Dry, Fuse)
