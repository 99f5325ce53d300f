"""Rotational spring, damper and actuator."""

import attrs

from dap3d_core.interface import (
    Body,
    Force,
    Vector,
    angle,
    body,
    choice,
    function,
    hookimpl,
    input_,
    joint_fields,
    number,
    vector,
)
from dap3d_core.kernels import atan2, cos, cross, dot, neg, normals, scale, sin, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class AngleFields:
    """Fields of what acts by the angle between two bodies."""

    joint: str = joint_fields(
        "body_i", "body_j", axis="a_j", acts_in="angle", doc="the hinge that it acts in"
    )
    body_i: Body = body(default=None, doc="body i; that of v_i")
    body_j: Body = body(default=None, doc="body j; that of v_j")
    v_i: Vector = vector(None, across="axis", doc="direction it is measured from, on body i")
    v_j: Vector = vector(None, across="axis", doc="direction it is measured to, on body j")
    axis: Vector = vector(doc="common axis, on either body")


attrs.define(AngleFields, slots=False, kw_only=True)


class Torsion(AngleFields, Force):
    """Spring, damper and actuator, in parallel, about an axis u common to two bodies.

    A positive n_a increases the angle that a ``rev`` or ``cyl`` about u of the same bodies i and j
    reports; it decreases theta, which has the sign of the manual (``rot_sda``): theta is
    the angle of body j relative to body i about u, from v_i to v_j, both projected on the plane
    normal to u; theta_dot = u . (w_j - w_i):

        theta = atan2(u . (v_i x v_j), v_i . v_j - (v_i . u) (v_j . u))
        T = k x + c theta_dot + n_a, moment T u on body i and -T u on body j
        energy = k x^2 / 2

    Where the scene names the ``joint``, v_i and v_j are one direction in its poses: theta is zero
    there, and always the opposite of the angle that the joint reports.

    x = theta - theta_0, brought into (-pi, pi]: half a turn from theta_0 the moment of the spring
    jumps. The actuator's moment n_a has no single-valued potential then and counts as work. With
    ``turns`` x counts whole turns, and energy = k x^2 / 2 + n_a x. A function of x takes the place
    of k x: T = f(x) + c theta_dot + n_a, without an energy. An input multiplies n_a, which then
    counts as work.
    """

    keyword = "rot_sda"
    synonyms = ("rsda", "torsion", "torsional-spring")
    actuates = "n_a"
    symbol = "ring"
    energy_where = "where the bodies turn about the common axis, and without n_a"

    k: float = number(default=0.0, unit="N m/rad", usual=(0.0, None), doc="stiffness")
    c: float = number(default=0.0, unit="N m s/rad", usual=(0.0, None), doc="damping coefficient")
    theta_0: float = number(default=0.0, unit="rad", doc="angle without moment of the spring")
    n_a: float = number(default=0.0, unit="N m", doc="moment of the actuator; theta falls by it")
    turns: bool = choice((False, True), default=False, doc="whether whole turns are counted")
    input: str = input_(doc="factor of n_a, an input")
    function: str = function(argument="theta - theta_0", doc="moment, N m, in place of k x")

    def prepare(self, bodies):
        start = {"start": (cos(self.theta_0), sin(self.theta_0))}
        return start | marks(self, bodies)

    def wrench(v_i, v_j, axis, start, w_i, w_j, k, c, n_a):
        rate = dot(axis, sub(w_j, w_i))
        return pair(k * wrapped(v_i, v_j, axis, start) + c * rate + n_a, axis)

    def energy(v_i, v_j, axis, start, k):
        x = wrapped(v_i, v_j, axis, start)
        return 0.5 * k * x * x


class Actuated(Torsion, turns=False, function=False, input=True):
    """The actuator's moment times an input."""

    def wrench(v_i, v_j, axis, start, w_i, w_j, k, c, n_a, input):
        rate = dot(axis, sub(w_j, w_i))
        return pair(k * wrapped(v_i, v_j, axis, start) + c * rate + input * n_a, axis)


class Curve(Torsion, turns=False, function=True, input=False):
    """The spring is a function of the angle."""

    energy = None

    def wrench(v_i, v_j, axis, start, w_i, w_j, c, n_a, f):
        rate = dot(axis, sub(w_j, w_i))
        return pair(f(wrapped(v_i, v_j, axis, start)) + c * rate + n_a, axis)


class ActuatedCurve(Torsion, turns=False, function=True, input=True):
    """A spring curve, and the actuator's moment times an input."""

    energy = None

    def wrench(v_i, v_j, axis, start, w_i, w_j, c, n_a, f, input):
        rate = dot(axis, sub(w_j, w_i))
        return pair(f(wrapped(v_i, v_j, axis, start)) + c * rate + input * n_a, axis)


class Turning(Torsion, turns=True, function=False, input=False):
    """The spring winds up over whole turns."""

    energy_where = "where the bodies turn about the common axis"
    theta: float = angle("v_i", "v_j", "axis")

    def wrench(axis, theta, theta_dot, k, c, theta_0, n_a):
        return pair(k * (theta - theta_0) + c * theta_dot + n_a, axis)

    def energy(theta, k, theta_0, n_a):
        x = theta - theta_0
        return (0.5 * k * x + n_a) * x


class ActuatedTurning(Turning, turns=True, function=False, input=True):
    """The spring winds up over whole turns, and the actuator's moment is times an input."""

    energy_where = "where the bodies turn about the common axis, and without n_a"

    def wrench(axis, theta, theta_dot, k, c, theta_0, n_a, input):
        return pair(k * (theta - theta_0) + c * theta_dot + input * n_a, axis)

    def energy(theta, k, theta_0):
        x = theta - theta_0
        return 0.5 * k * x * x


class TurningCurve(Turning, turns=True, function=True, input=False):
    """The spring is a function of the angle, over whole turns."""

    energy = None

    def wrench(axis, theta, theta_dot, c, theta_0, n_a, f):
        return pair(f(theta - theta_0) + c * theta_dot + n_a, axis)


class ActuatedTurningCurve(Turning, turns=True, function=True, input=True):
    """A spring curve over whole turns, and the actuator's moment times an input."""

    energy = None

    def wrench(axis, theta, theta_dot, c, theta_0, n_a, f, input):
        return pair(f(theta - theta_0) + c * theta_dot + input * n_a, axis)


def wrapped(v_i, v_j, axis, start):
    """The angle theta - theta_0 in (-pi, pi]; start holds cosine and sine of theta_0."""
    y, x = dot(axis, cross(v_i, v_j)), dot(v_i, v_j) - dot(v_i, axis) * dot(v_j, axis)
    return atan2(y * start[0] - x * start[1], x * start[0] + y * start[1])


def marks(element, bodies):
    """V_i and v_j that are one direction in the poses as given, where the scene names a joint."""
    if element.v_i is not None and element.v_j is not None:
        return {}
    if element.joint is None or element.v_i is not None or element.v_j is not None:
        raise ValueError("give joint, or v_i and v_j")
    n, _ = normals(element.axis)  # that of the joint, on body j
    return {"v_i": bodies["i"].to_local(bodies["j"].to_global(n)), "v_j": n}


def pair(T, axis):
    """The moment T about the axis on body i, and its opposite on body j."""
    moment = scale(T, axis)
    return (ZERO, moment), (ZERO, neg(moment))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Torsion]
