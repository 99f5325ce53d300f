"""Dry friction of hinges and sliders that does not depend on their load."""

from dap3d_core.interface import (
    Body,
    Force,
    Point,
    Vector,
    body,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import dot, sub, tanh
from dap3d_forces.axial_spring import along, pull
from dap3d_forces.torsion import pair

interface_version = 1


class RotationFriction(Force):
    """A friction moment of constant size about an axis u, against the rate of a hinge.

    n_c is that of seals, gears and preloaded bearings, whatever the joint carries; ``friction`` is
    the one that grows with the load. With the rate w of body i against body j:

        w = u . (w_i - w_j),  moment -n_c tanh(w / w_tol) u on body i, its opposite on body j

    There is no sticking: below w_tol friction fades, and a hinge that should stick under a moment
    M creeps at w_tol artanh(M / n_c). Free, it slows from w_tol by the time constant I w_tol / n_c,
    which is stiff where that is short.
    """

    keyword = "rot_friction"
    symbol = "ring"
    regularised = "w_tol"
    joint: str = joint_fields("body_i", "body_j", axis="a_j", doc="the hinge that rubs")
    body_i: Body = body(doc="body that turns")
    body_j: Body = body(doc="body against which it turns")
    axis: Vector = vector(doc="axis, on either body")
    n_c: float = number(unit="N m", minimum=0.0, doc="friction moment")
    w_tol: float = number(
        default=1e-3, unit="rad/s", positive=True, doc="rate below which friction fades"
    )

    def wrench(axis, w_i, w_j, n_c, w_tol):
        return pair(-n_c * tanh(dot(axis, sub(w_i, w_j)) / w_tol), axis)


class TranslationFriction(Force):
    """A friction force of constant size along an axis, against the velocity of a slider.

    As ``rot_friction``, with the velocity v of P_i along a_j as seen from body j:

        v = a_j . (v_Pi - v_j - w_j x (r_Pi - r_j))
        force -f_c tanh(v / v_tol) a_j at P_i on body i, its opposite there on body j
    """

    keyword = "tran_friction"
    regularised = "v_tol"
    joint: str = joint_fields("P_i", "a_j", doc="the slider that rubs")
    P_i: Point = point(doc="where body i slides")
    a_j: Vector = vector(doc="axis it slides along, on body j")
    f_c: float = number(unit="N", minimum=0.0, doc="friction force")
    v_tol: float = number(
        default=1e-3, unit="m/s", positive=True, doc="velocity below which friction fades"
    )

    def wrench(a_j, r_P_i, v_P_i, s_P_i, r_j, v_j, w_j, f_c, v_tol):
        _, v = along(a_j, r_P_i, r_j, v_P_i, v_j, w_j)
        return pull(f_c * tanh(v / v_tol), a_j, s_P_i, r_P_i, r_j)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [RotationFriction, TranslationFriction]
