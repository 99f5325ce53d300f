"""Relative rotation driver: prescribes how fast one body turns against another about an axis."""

from dap3d_core.interface import (
    Body,
    Joint,
    Vector,
    body,
    function,
    hookimpl,
    input_,
    joint_fields,
    vector,
)
from dap3d_core.kernels import cross, dot, neg, row

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class RelativeRotation(Joint):
    """The rate of rotation of body j against body i along a_j is f_dot(t) (manual: ``rel-rot``).

    Sign of the manual: a growing f, or a positive input, decreases the angle that a ``rev`` or
    ``cyl`` of the same bodies i and j reports; ``drive-rot`` increases it.

    One row, of the velocity level alone; without a function it locks the rotation. An
    input may give the rate in place of f_dot: it is held, and velocities jump where it is set.

        J v   = a_j . (w_j - w_i) = f_dot = nu
        J_i   = [0, -a_j^T],  J_j = [0, a_j^T]
        gamma = f_ddot - a_j . (w_j x w_i)
    """

    keyword, rows, holonomic = "rel-rot", 1, False
    symbol = "ring"
    drives = True
    joint: str = joint_fields("body_i", "body_j", "a_j", doc="the joint whose coordinate it drives")
    body_i: Body = body(doc="body whose rotation the driver is measured from")
    body_j: Body = body(default="ground", doc="body that is turned")
    a_j: Vector = vector(doc="axis, on body j")
    function: str = function(doc="angle as a function of time; only its rates are used")
    input: str = input_(instead_of="function", unit="rad/s", doc="rate of rotation")

    def J(a_j):
        return row(ZERO, neg(a_j)), row(ZERO, a_j)

    def nu(f_dot):
        return f_dot

    def gamma(a_j, w_i, w_j, f_ddot):
        return f_ddot - dot(a_j, cross(w_j, w_i))


class Held(RelativeRotation, input=True):
    """The rate is an input."""

    def nu(input):
        return input

    def gamma(a_j, w_i, w_j):
        return -dot(a_j, cross(w_j, w_i))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [RelativeRotation]
