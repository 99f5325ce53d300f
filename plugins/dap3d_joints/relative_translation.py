"""Relative translation driver: prescribes how fast a mass centre moves against another."""

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
from dap3d_core.kernels import dot, neg, row, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class RelativeTranslation(Joint):
    """The velocity of mass centre j relative to mass centre i, along a_j, is f_dot(t).

    Sign of the manual: a growing f, or a positive input, decreases the length that a ``tran`` or
    ``cyl`` of the same bodies i and j reports; ``drive-tran`` increases it.

    Manual: ``rel-tran``, whose Jacobian stands in the wrong slots. One row, of the
    velocity level alone; without a function it locks the relative translation. An input may give
    the velocity in place of f_dot: it is held, and velocities jump where it is set.

        J v   = a_j . (r_dot_j - r_dot_i) = f_dot = nu
        J_i   = [-a_j^T, 0],  J_j = [a_j^T, 0]
        gamma = f_ddot - a_j_dot . (r_dot_j - r_dot_i)

    Where body j turns this is not the rate of sliding in a translational joint.
    """

    keyword, rows, holonomic = "rel-tran", 1, False
    drives = True
    joint: str = joint_fields("body_i", "body_j", "a_j", doc="the joint whose coordinate it drives")
    body_i: Body = body(doc="body that the motion is measured from")
    body_j: Body = body(default="ground", doc="body that is moved")
    a_j: Vector = vector(doc="direction, on body j")
    function: str = function(doc="distance as a function of time; only its rates are used")
    input: str = input_(instead_of="function", unit="m/s", doc="relative velocity")

    def J(a_j):
        return row(neg(a_j), ZERO), row(a_j, ZERO)

    def nu(f_dot):
        return f_dot

    def gamma(a_j_dot, v_i, v_j, f_ddot):
        return f_ddot - dot(a_j_dot, sub(v_j, v_i))


class Held(RelativeTranslation, input=True):
    """The velocity is an input."""

    def nu(input):
        return input

    def gamma(a_j_dot, v_i, v_j):
        return -dot(a_j_dot, sub(v_j, v_i))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [RelativeTranslation]
