"""A point that stays on a curve: beads on wires, pins in slots."""

from dap3d_core.interface import REQUIRED, Joint, Point, function, hookimpl, number, point
from dap3d_core.kernels import rotate, sub, transpose

interface_version = 1


class OnCurve(Joint):
    """P_i stays on the curve x(s), y(s), z(s), in axes of body j, from P_j.

    With d = A_j^T (r_Pi - r_Pj) two rows remain of three, as s is an unknown of the joint:

        C = (d_x - x(s), d_y - y(s), d_z - z(s))

    Without ``z`` it is a slot in a plate: where P_i is along z has no part, and one row remains of
    d_x and d_y. The joint pulls as well as it pushes, without friction; what may lift off is the
    contact ``point_curve``. Where s passes ``s_min`` or ``s_max`` the run ends; without bounds s
    goes on as far as the functions do, and of a closed curve, of periodic functions, counts turns.
    x, y and z are smooth, and never stand still all at once.
    """

    keyword, rows, unknowns = "oncurve", 2, ("s",)
    synonyms = ("slot", "wire", "bead")
    symbol = "block"
    P_i: Point = point(doc="the point that stays on the curve")
    P_j: Point = point("ground.O", doc="origin of the curve")
    x: str = function(REQUIRED, argument="s", doc="x of the curve, m")
    y: str = function(REQUIRED, argument="s", doc="y of the curve, m")
    z: str = function(argument="s", doc="z of a curve in space, m")
    s_0: float = number(0.0, doc="value near which s is sought at the start")

    def C(r_P_i, r_P_j, A_j, s, x, y):
        d = rotate(transpose(A_j), sub(r_P_i, r_P_j))
        return d[0] - x(s), d[1] - y(s)


class InSpace(OnCurve, z=True):
    """The curve is in space."""

    rows = 3

    def C(r_P_i, r_P_j, A_j, s, x, y, z):
        d = rotate(transpose(A_j), sub(r_P_i, r_P_j))
        return d[0] - x(s), d[1] - y(s), d[2] - z(s)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [OnCurve]
