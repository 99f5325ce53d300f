"""Dry friction of hinges and sliders that does not depend on their load."""

import warnings

from dap3d_core.interface import (
    Body,
    Contact,
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

        w = u . (w_i - w_j),  moment -n_c sign(w) u on body i, its opposite on body j

    At rest it sticks, by up to n_s, exactly, as contacts do (docs/concepts/contact.md). With w_tol
    it is regularised, -n_c tanh(w / w_tol), for runs that take no contacts: below w_tol friction
    fades, and a hinge that should stick under a moment M creeps at w_tol artanh(M / n_c). Free, it
    slows from w_tol by the time constant I w_tol / n_c, which is stiff where that is short.
    """

    keyword = "rot_friction"
    symbol = "ring"
    regularised = "w_tol"
    joint: str = joint_fields("body_i", "body_j", axis="a_j", doc="the hinge that rubs")
    body_i: Body = body(doc="body that turns")
    body_j: Body = body(doc="body against which it turns")
    axis: Vector = vector(doc="axis, on either body")
    n_c: float = number(unit="N m", minimum=0.0, doc="friction moment")
    n_s: float = number(
        None, unit="N m", minimum=0.0, doc="at most where it sticks; n_c by default"
    )
    w_tol: float = number(
        None, unit="rad/s", positive=True, doc="rate below which it fades; sticks without it"
    )

    def prepare(self, bodies):
        return unused(self.n_s, "n_s", "w_tol")

    def wrench(axis, w_i, w_j, n_c, w_tol):
        return pair(-n_c * tanh(dot(axis, sub(w_i, w_j)) / w_tol), axis)


class StickingRotation(Contact, of=RotationFriction, w_tol=False):
    """It sticks at rest."""

    keyword, symbol = "rot_friction", "ring"
    shared = ("joint", "body_i", "body_j", "axis", "n_c", "n_s")

    def prepare(self, bodies):
        return sizes(self.n_c, self.n_s, "n_c", "n_s")

    def along(axis):
        return axis


class TranslationFriction(Force):
    """A friction force of constant size along an axis, against the velocity of a slider.

    As ``rot_friction``, with the velocity v of P_i along a_j as seen from body j:

        v = a_j . (v_Pi - v_j - w_j x (r_Pi - r_j))
        force -f_c sign(v) a_j at P_i on body i, its opposite there on body j; with v_tol
        -f_c tanh(v / v_tol) a_j
    """

    keyword = "tran_friction"
    regularised = "v_tol"
    joint: str = joint_fields("P_i", "a_j", doc="the slider that rubs")
    P_i: Point = point(doc="where body i slides")
    a_j: Vector = vector(doc="axis it slides along, on body j")
    f_c: float = number(unit="N", minimum=0.0, doc="friction force")
    f_s: float = number(None, unit="N", minimum=0.0, doc="at most where it sticks; f_c by default")
    v_tol: float = number(
        None, unit="m/s", positive=True, doc="velocity below which it fades; sticks without it"
    )

    def prepare(self, bodies):
        return unused(self.f_s, "f_s", "v_tol")

    def wrench(a_j, r_P_i, v_P_i, s_P_i, r_j, v_j, w_j, f_c, v_tol):
        _, v = along(a_j, r_P_i, r_j, v_P_i, v_j, w_j)
        return pull(f_c * tanh(v / v_tol), a_j, s_P_i, r_P_i, r_j)


class StickingTranslation(Contact, of=TranslationFriction, v_tol=False):
    """It sticks at rest."""

    keyword = "tran_friction"
    shared = ("joint", "P_i", "a_j", "f_c", "f_s")

    def prepare(self, bodies):
        return sizes(self.f_c, self.f_s, "f_c", "f_s")

    def along(a_j):
        return a_j

    def at(r_P_i):
        return r_P_i


def sizes(slides, sticks, sliding, sticking):
    """Friction where it slides and, at most, where it sticks; names of the two fields."""
    most = slides if sticks is None else sticks
    if most < slides:
        what = f"{sticking} = {most:g} is less than {sliding} = {slides:g}"
        raise ValueError(f"{what}; what slides would stick more than rest")
    return {"mu": slides, "mu_s": most, sticking: most}


def unused(sticks, sticking, tolerance):
    """The friction of what sticks where nothing does, with a note where it is given."""
    if sticks is not None:
        what = f"{sticking} is of friction that sticks, and with {tolerance} none does"
        warnings.warn(f"{what}: it has no part", stacklevel=3)
    return {sticking: 0.0 if sticks is None else sticks}


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [RotationFriction, TranslationFriction]
