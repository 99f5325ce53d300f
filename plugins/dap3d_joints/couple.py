"""Coupled rotations: two wheels turn in a fixed ratio against a third body."""

from dap3d_core.interface import Body, Joint, Vector, body, choice, hookimpl, number, vector
from dap3d_core.kernels import add, dot, neg, row, scale, sub
from dap3d_joints.turning import line_accelerations, line_rates, references, turned_by, wrapped

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Couple(Joint):
    """Gears i and j, which turn against the carrier k about their axes, stay in mesh.

    It transmits moments alone, about a_i and a_j, and the carrier takes their sum: motion and power
    are right, and there is no tooth force. The bearings of the gears carry what else acts on the
    gears, and neither the tooth force T / r nor what a pressure angle or a helix adds to it: of an
    idler between two gears they carry nothing of 2 T / r.

    theta_i and theta_j are the angles of the gears against the carrier about a_i and a_j, zero in
    the poses as given, z_i and z_j their numbers of teeth. One row, the angle of gear i:

        C = wrapped(z_i theta_i + s z_j theta_j) / z_i

    with s = 1 for teeth outside on both gears, s = -1 where one gear is a ring with its teeth
    inside. Whole turns of a gear are whole numbers of teeth, so no turns need be counted: what is
    wrapped into (-pi, pi], half a tooth, is the error alone. The rate of
    theta_i is e_i . (w_i - w_k), with e_i = u_k x (a_i x u_k) / |a_i x u_k|^2, u_k a mark on k.

    With bevel gears a_i and a_j differ in direction; with both pointing away from the meeting point
    of the axes s = 1 is right.
    """

    keyword, rows = "couple", 1
    synonyms = ("coupler", "ratio", "transmission")
    a_i: Vector = vector(doc="axis of gear i, on that gear")
    a_j: Vector = vector(doc="axis of gear j, on that gear, or on ground for a fixed ring")
    body_k: Body = body(default="ground", doc="carrier, which holds the bearings of both")
    teeth_i: float = number(minimum=1.0, whole=True, doc="number of teeth of gear i")
    teeth_j: float = number(minimum=1.0, whole=True, doc="number of teeth of gear j")
    mesh: str = choice(("external", "internal"), "external", doc="internal: one gear is a ring")

    def prepare(self, bodies):
        e, f, u = references(self.a_i, bodies["i"], bodies["k"])
        n, m, v = references(self.a_j, bodies["j"], bodies["k"])
        sense = 1.0 if self.mesh == "external" else -1.0
        return {"e_i": e, "f_i": f, "u_k": u, "n_j": n, "m_j": m, "b_k": v, "sense": sense}

    def C(e_i, f_i, u_k, n_j, m_j, b_k, teeth_i, teeth_j, sense):
        theta_i, theta_j = turned_by(e_i, f_i, u_k), turned_by(n_j, m_j, b_k)
        return wrapped(teeth_i * theta_i + sense * teeth_j * theta_j) / teeth_i

    def J(a_i, a_j, u_k, b_k, teeth_i, teeth_j, sense):
        e_i = line_rates(u_k, a_i)[1]
        e_j = scale(sense * teeth_j / teeth_i, line_rates(b_k, a_j)[1])
        return row(ZERO, e_i), row(ZERO, e_j), row(ZERO, neg(add(e_i, e_j)))

    def gamma(
        a_i, a_j, u_k, b_k, a_i_dot, a_j_dot, u_k_dot, b_k_dot, w_i, w_j, w_k, teeth_i, teeth_j,
        sense,
    ):  # fmt: skip
        e_i = line_accelerations(u_k, a_i, u_k_dot, a_i_dot)[1]
        e_j = line_accelerations(b_k, a_j, b_k_dot, a_j_dot)[1]
        ratio = sense * teeth_j / teeth_i
        return -dot(e_i, sub(w_i, w_k)) - ratio * dot(e_j, sub(w_j, w_k))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Couple]
