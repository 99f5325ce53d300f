"""Elastic cable over points of bodies."""

from dap3d_core.interface import Force, choice, function, hookimpl, input_, number, points
from dap3d_core.kernels import by_body, cross, maximum, scale, where
from dap3d_joints.cable import length_at_start, length_rate, pulls, spans

interface_version = 1


class ElasticCable(Force):
    """Spring and damper, in parallel, along a massless cable from point to point.

    The first and the last of the ``points`` are its ends; over the others it runs without friction,
    as over pulleys of no radius and no mass. They may lie on any bodies, several on one. One
    tension T acts along all of it; with the length l, the sum of its spans, and x = l - (L + f):

        T = k x + c (l_dot - f_dot),  energy = k x^2 / 2
        force T p_k at point k, p_k = u_k - u_(k-1) of the unit vectors u_k along the spans

    L is ``length``; left out it is that of the start, and f is counted from f(0). A growing f pays
    out; an ``input``, m, held between settings, takes its place, with the rate zero. T = 0 where
    x < 0 or the sum is negative: a cable becomes slack, and does not push. With slack = false T may
    be negative: one of a pretension, which what the model leaves out keeps taut. Of constant
    length: joint ``cable``.
    """

    keyword = "cable"
    synonyms = ("rope", "winch", "hoist")
    points: tuple = points("n", least=2, doc="ends and pulleys, in order along the cable")
    length: float = number(
        default=None, unit="m", positive=True, doc="length without tension; as at the start"
    )
    k: float = number(unit="N/m", minimum=0.0, doc="stiffness of the whole cable")
    c: float = number(default=0.0, unit="N s/m", minimum=0.0, doc="damping coefficient")
    slack: bool = choice((False, True), True, doc="the cable becomes slack, and does not push")
    function: str = function(doc="m, by which the cable is longer, as a function of time")
    input: str = input_(instead_of="function", unit="m", doc="by which the cable is longer")

    def prepare(self, bodies):
        total = length_at_start(self.points, bodies["points"])
        pushes = 0.0 if self.slack else 1.0
        if self.length is not None:
            return {"length": self.length, "counted": 0.0, "pushes": pushes}
        return {"length": total, "counted": 1.0, "pushes": pushes}

    def wrench(r_points, s_points, v_points, on_points, body_count, length, pushes, k, c):
        x = stretch(r_points, length)
        T = tension(x, length_rate(r_points, v_points), k, c, pushes)
        return pulled(T, r_points, s_points, on_points, body_count)

    def tension(r_points, v_points, length, pushes, k, c):
        x = stretch(r_points, length)
        return tension(x, length_rate(r_points, v_points), k, c, pushes)

    def energy(r_points, length, pushes, k):
        return stored(stretch(r_points, length), k, pushes)

    def switch(r_points, length, pushes):
        return where(pushes > 0.0, 1.0, stretch(r_points, length))


class Driven(ElasticCable, function=True):
    """The change of the length is a function of time."""

    energy_where = "without c"

    def wrench(r_points, s_points, v_points, on_points, body_count, length, counted, pushes, k, c,
               f, f_0, f_dot):  # fmt: skip
        x = stretch(r_points, length + (f - counted * f_0))
        T = tension(x, length_rate(r_points, v_points) - f_dot, k, c, pushes)
        return pulled(T, r_points, s_points, on_points, body_count)

    def tension(r_points, v_points, length, counted, pushes, k, c, f, f_0, f_dot):
        x = stretch(r_points, length + (f - counted * f_0))
        return tension(x, length_rate(r_points, v_points) - f_dot, k, c, pushes)

    def energy(r_points, length, counted, pushes, k, f, f_0):
        return stored(stretch(r_points, length + (f - counted * f_0)), k, pushes)

    def switch(r_points, length, counted, pushes, f, f_0):
        return where(pushes > 0.0, 1.0, stretch(r_points, length + (f - counted * f_0)))


class Wound(ElasticCable, input=True):
    """The change of the length is an input, held between settings."""

    def wrench(r_points, s_points, v_points, on_points, body_count, length, pushes, k, c, input):
        x = stretch(r_points, length + input)
        T = tension(x, length_rate(r_points, v_points), k, c, pushes)
        return pulled(T, r_points, s_points, on_points, body_count)

    def tension(r_points, v_points, length, pushes, k, c, input):
        x = stretch(r_points, length + input)
        return tension(x, length_rate(r_points, v_points), k, c, pushes)

    def energy(r_points, length, pushes, k, input):
        return stored(stretch(r_points, length + input), k, pushes)

    def switch(r_points, length, pushes, input):
        return where(pushes > 0.0, 1.0, stretch(r_points, length + input))


def stretch(r_points, length):
    """Elongation, m."""
    return sum(spans(r_points)[0]) - length


def tension(x, rate, k, c, pushes):
    """Tension, N, of an elongation and its rate; pushes: 0 of a cable that becomes slack."""
    T = k * x + c * rate
    held = where(x < 0.0, 0.0, maximum(T, 0.0))
    return where(pushes > 0.0, T, held)


def stored(x, k, pushes):
    """Potential, J."""
    x = where(pushes > 0.0, x, maximum(x, 0.0))
    return 0.5 * k * x * x


def pulled(T, r_points, s_points, on_points, body_count):
    """The wrench of a tension on each body."""
    forces = [scale(T, p) for p in pulls(r_points)]
    parts = [(F, cross(s, F)) for F, s in zip(forces, s_points, strict=True)]
    return by_body(on_points, parts, body_count)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [ElasticCable]
