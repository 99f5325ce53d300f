"""Point-to-point spring, damper and actuator."""

from dap3d_core.interface import Force, Vector2, function, hookimpl, input_, number, vector2
from dap3d_core.kernels import add, cross, dot, neg, scale, sqrt

interface_version = 1

#: m^2, N: less than the last digit of any square of a length.
NEAR = 1e-140


class PointToPoint(Force):
    """Spring, damper and actuator, in parallel, on the line from P_i to P_j (manual: ``ptp``).

    Sign of the manual: a positive f_a is a tension, and decreases the length. With
    l = |d|, u = d / l and l_dot = u . d_dot:

        F = k (l - l0) + c l_dot + f_a,  force F u at P_i on body i and -F u at P_j on body j
        energy = k (l - l0)^2 / 2 + f_a l

    A function of l - l0 takes the place of k (l - l0): F = f(l - l0) + c l_dot + f_a, without an
    energy. A factor, a function of time, or an input multiplies f_a, which then counts as work.
    Where the two points coincide u is undefined: a scene that starts so is refused, and a
    run that comes there stops and says so. With l0 = 0, without f_a and function, no direction is
    needed: the spring is k d, and the damper acts along the motion, c d_dot.
    """

    keyword = "ptp"
    synonyms = ("spring", "damper", "tsda", "spring-damper")
    actuates = "f_a"
    d: Vector2 = vector2(
        direction=("l0", "f_a", "function"), doc="from the end on body i to the end on body j"
    )
    k: float = number(default=0.0, unit="N/m", usual=(0.0, None), doc="stiffness")
    c: float = number(default=0.0, unit="N s/m", usual=(0.0, None), doc="damping coefficient")
    l0: float = number(default=0.0, unit="m", minimum=0.0, doc="undeformed length")
    f_a: float = number(default=0.0, unit="N", doc="force of the actuator, tension positive")

    factor: str = function(doc="factor of f_a, a function of time")
    input: str = input_(instead_of="factor", doc="factor of f_a, an input")
    function: str = function(argument="l - l0", doc="force, N, in place of k (l - l0)")

    def wrench(d, d_dot, s_P_i, s_P_j, k, c, l0, f_a):
        bound = l0 * l0 + f_a * f_a
        return spring_pull(d, d_dot, s_P_i, s_P_j, k, c, l0, f_a, bound)

    def energy(d, k, l0, f_a):
        length = sqrt(dot(d, d))
        return 0.5 * k * (length - l0) * (length - l0) + f_a * length


class OfTime(PointToPoint, function=False, factor=True):
    """The actuator's force times a function of time."""

    energy_where = "without f_a"

    def wrench(d, d_dot, s_P_i, s_P_j, k, c, l0, f_a, factor):
        bound = l0 * l0 + f_a * f_a
        return spring_pull(d, d_dot, s_P_i, s_P_j, k, c, l0, factor * f_a, bound)

    def energy(d, k, l0):
        return spring_energy(d, k, l0)


class Actuated(PointToPoint, function=False, input=True):
    """The actuator's force times an input."""

    energy_where = "without f_a"

    def wrench(d, d_dot, s_P_i, s_P_j, k, c, l0, f_a, input):
        bound = l0 * l0 + f_a * f_a
        return spring_pull(d, d_dot, s_P_i, s_P_j, k, c, l0, input * f_a, bound)

    def energy(d, k, l0):
        return spring_energy(d, k, l0)


class Curve(PointToPoint, function=True, factor=False, input=False):
    """The spring is a function of the elongation."""

    energy = None

    def wrench(d, d_dot, s_P_i, s_P_j, c, l0, f_a, f):
        return curve_pull(d, d_dot, s_P_i, s_P_j, c, l0, f, f_a)


class CurveOfTime(PointToPoint, function=True, factor=True):
    """A spring curve, and the actuator's force times a function of time."""

    energy = None

    def wrench(d, d_dot, s_P_i, s_P_j, c, l0, f_a, f, factor):
        return curve_pull(d, d_dot, s_P_i, s_P_j, c, l0, f, factor * f_a)


class ActuatedCurve(PointToPoint, function=True, input=True):
    """A spring curve, and the actuator's force times an input."""

    energy = None

    def wrench(d, d_dot, s_P_i, s_P_j, c, l0, f_a, f, input):
        return curve_pull(d, d_dot, s_P_i, s_P_j, c, l0, f, input * f_a)


def spring_energy(d, k, l0):
    """Potential k (l - l0)^2 / 2."""
    x = sqrt(dot(d, d)) - l0
    return 0.5 * k * x * x


def line(d, bound):
    """Length of d, unit vector along it, and 0, or 1 at zero length.

    Where there is no force at zero length (bound = 0) the unit vector is zero there, and T u has
    the derivative T / length; else neither is a number.
    """
    part = NEAR / (NEAR + bound)
    near = NEAR * (part * part)  # underflows with a bound
    square = dot(d, d)
    length = sqrt(square + near)
    return length, scale(1.0 / length, d), 1.0 - square / (square + near)


def pull(T, u, s_i, s_j):
    """The tension T along u at the ends of the arms."""
    return at_ends(scale(T, u), s_i, s_j)


def spring_pull(d, d_dot, s_i, s_j, k, c, l0, F, bound):
    """The pull of a spring, a damper and an actuator's force F; bound: as of ``line``."""
    length, u, at_zero = line(d, bound)
    T = k * (length - l0) + c * dot(u, d_dot) + F
    return at_ends(add(scale(T, u), scale(at_zero * c, d_dot)), s_i, s_j)


def curve_pull(d, d_dot, s_i, s_j, c, l0, f, F):
    """The pull of a spring curve f, a damper and an actuator's force F."""
    length = sqrt(dot(d, d))
    u = scale(1.0 / length, d)
    return pull(f(length - l0) + c * dot(u, d_dot) + F, u, s_i, s_j)


def at_ends(F, s_i, s_j):
    """The force F on body i, and its opposite on body j, at the ends of the arms."""
    return (F, cross(s_i, F)), (neg(F), neg(cross(s_j, F)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [PointToPoint]
