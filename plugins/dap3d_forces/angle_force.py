"""Force along an axis that follows the angle of a hinge elsewhere."""

from dap3d_core.interface import (
    REQUIRED,
    Body,
    Force,
    Point,
    Vector,
    angle,
    body,
    function,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import normals
from dap3d_forces.axial_spring import pull

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class AngleForce(Force):
    """A force along a_j at P_i by the angle of a hinge: gas over the crank angle, a cam.

    theta is the angle by which body k has turned against body j about b_j, zero in the poses as
    given, and counts turns:

        F = f(theta + theta_0),  force F a_j at P_i on body i, -F a_j there on body j

    A positive F increases the length that a ``tran`` of the same bodies i and j reports. The hinge
    takes no moment of it: what turns it does so through the mechanism. A spline that is periodic
    over 4 pi is that of a four-stroke engine. The force is work, and has no energy.
    """

    keyword = "angle_force"
    synonyms = ("gas-force", "gas", "cam-force")
    joint: str = joint_fields("P_i", "a_j", doc="the slider in which it acts")
    hinge: str = joint_fields(body_k="body_i", b_j="a_j", doc="hinge of body k on body j")
    P_i: Point = point(doc="where the force acts, on body i")
    a_j: Vector = vector(doc="axis, on body j, on which the opposite acts")
    body_k: Body = body(doc="body that turns, a crankshaft")
    b_j: Vector = vector(doc="axis of the hinge, on body j")
    function: str = function(REQUIRED, argument="the angle, rad", doc="force, N")
    theta_0: float = number(0.0, unit="rad", doc="the angle in the poses as given")
    theta: float = angle("n_j", "u_k", "b_j")

    def prepare(self, bodies):
        n, _ = normals(self.b_j)
        return {"n_j": n, "u_k": bodies["k"].to_local(bodies["j"].to_global(n))}

    def wrench(a_j, s_P_i, r_P_i, r_j, theta, theta_0, f):
        on_i, on_j = pull(-f(theta + theta_0), a_j, s_P_i, r_P_i, r_j)
        return on_i, on_j, (ZERO, ZERO)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [AngleForce]
