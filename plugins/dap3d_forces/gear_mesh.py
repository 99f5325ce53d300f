"""Elastic mesh of two toothed wheels: stiffness, damping, backlash, pressure angle and helix."""

from math import cos, tan

from dap3d_core.interface import Force, hookimpl, number
from dap3d_core.kernels import abs as magnitude
from dap3d_core.kernels import add, atan2, cross, dot, floor, neg, scale, sign, sqrt, sub, where
from dap3d_joints.gear import Wheels, meshing, pitch_of

interface_version = 1

TURN = 6.283185307179586


class GearMesh(Wheels, Force):
    """Teeth of wheels i and j press on one another in the pitch point, and give way there.

    What the joint ``gear`` is for rigid teeth, with the same g, phi, radii and sense s. Along the
    tangent t = a_i x g / |g| the teeth are pressed together by delta, beyond the ``backlash``, and
    they touch on one flank or the other:

        delta = r_i / z_i wrapped(z_i phi_i + s z_j phi_j)
        x = delta - backlash / 2, delta + backlash / 2, or 0 in between
        F = k x + c delta_dot                              where the flanks touch, else 0

    On wheel i in the pitch point act -F t, a part that presses the wheels apart, whichever flank is
    in touch, and one along the axis:

        |F| tan(pressure_angle) / cos(helix)  away from wheel j,  -F tan(helix) a_i

    and their opposites on wheel j; with a ring, away from the flank that is in touch. With
    ``bevel`` the axes meet in P_i and P_j, and the fields are as of the joint. The force is work,
    and the ledger of a run has it so. Damping ends where the flanks part.
    """

    keyword = "gear"
    synonyms = ("mesh", "gearmesh")
    k: float = number(unit="N/m", minimum=0.0, doc="stiffness of the teeth, along the tangent")
    c: float = number(0.0, unit="N s/m", minimum=0.0, doc="damping")
    backlash: float = number(0.0, unit="m", minimum=0.0, doc="play of the teeth, on the circle")

    def prepare(self, bodies):
        sizes = meshing(self, bodies)
        side = -1.0 if self.internal else 1.0  # a ring presses the wheel in it towards its axis
        reach = sizes["radius_i"] + side * sizes["radius_j"]
        sizes |= {"along": tan(self.helix), "reach": reach, "part": sizes["radius_i"] / reach}
        sizes["per_tooth"] = sizes["radius_i"] / sizes["teeth_i"]
        if not self.bevel:
            apart = side * tan(self.pressure_angle) / cos(self.helix)
            return sizes | {"apart": (apart, 0.0), "at": (0.0, 0.0)}
        a, b = bodies["i"].to_global(self.a_i), bodies["j"].to_global(self.a_j)
        pitch = pitch_of(a, b, sizes["radius_i"], sizes["radius_j"], side)
        apart = tuple(tan(self.pressure_angle) * x for x in pitch["apart"])
        return sizes | {"apart": apart, "at": pitch["at"]}

    def wrench(
        r_P_i, r_P_j, s_P_i, s_P_j, v_i, v_j, w_i, w_j, a_i, u_i, u_j, m_j, teeth_i, teeth_j, sense,
        per_tooth, reach, part, apart, along, k, c, backlash,
    ):  # fmt: skip
        g = sub(r_P_j, r_P_i)
        c_i = cross(a_i, g)  # m_i . g is -u_i . c_i
        phi_i, phi_j = atan2(dot(u_i, c_i), dot(u_i, g)), atan2(-dot(m_j, g), dot(u_j, g))
        delta = per_tooth * without_turns(teeth_i * phi_i + sense * teeth_j * phi_j)
        inverse, pitch = 1.0 / dot(c_i, c_i), scale(part, g)  # the pitch point, from P_i
        arm_i, arm_j = add(s_P_i, pitch), sub(add(s_P_j, pitch), g)
        t = scale(reach * inverse, c_i)
        F = force_of(delta, t, arm_i, arm_j, v_i, v_j, w_i, w_j, k, c, backlash)
        lift = magnitude(F) * apart[0] * sqrt(inverse)
        axial = lift * dot(a_i, g) - F * along
        f = sub(scale(axial, a_i), add(scale(F, t), scale(lift, g)))
        return (f, cross(arm_i, f)), (neg(f), neg(cross(arm_j, f)))

    def switch(r_P_i, r_P_j, a_i, u_i, u_j, m_j, teeth_i, teeth_j, per_tooth, sense, backlash):
        g = sub(r_P_j, r_P_i)
        phi_i, phi_j = (
            atan2(dot(u_i, cross(a_i, g)), dot(u_i, g)), atan2(-dot(m_j, g), dot(u_j, g))
        )  # fmt: skip
        x = without_turns(teeth_i * phi_i + sense * teeth_j * phi_j)
        return play_of(per_tooth * x, backlash)


class BevelMesh(GearMesh, bevel=True):
    """The axes meet."""

    def wrench(
        r_P_i, r_i, r_j, v_i, v_j, w_i, w_j, a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, teeth_j, sense,
        per_tooth, lever, at, apart, k, c, backlash,
    ):  # fmt: skip
        delta = per_tooth * rolled(a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, sense * teeth_j)
        pitch = add(r_P_i, add(scale(at[0], a_i), scale(at[1], a_j)))
        arm_i, arm_j, t = sub(pitch, r_i), sub(pitch, r_j), scale(lever, cross(a_i, a_j))
        F = force_of(delta, t, arm_i, arm_j, v_i, v_j, w_i, w_j, k, c, backlash)
        lift = magnitude(F)
        f = sub(add(scale(lift * apart[0], a_i), scale(lift * apart[1], a_j)), scale(F, t))
        return (f, cross(arm_i, f)), (neg(f), neg(cross(arm_j, f)))

    def switch(a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, teeth_j, per_tooth, sense, backlash):
        x = rolled(a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, sense * teeth_j)
        return play_of(per_tooth * x, backlash)


def rolled(a_i, a_j, u_i, m_i, u_j, m_j, teeth_i, teeth_j):
    """By what angle of a tooth bevel gears are apart from rolling."""
    phi_i, phi_j = atan2(-dot(m_i, a_j), dot(u_i, a_j)), atan2(-dot(m_j, a_i), dot(u_j, a_i))
    return without_turns(teeth_i * phi_i + teeth_j * phi_j)


def without_turns(x):
    """The angle without its whole turns, which are whole teeth, in [-pi, pi)."""
    return x - TURN * floor(x / TURN + 0.5)


def force_of(delta, t, arm_i, arm_j, v_i, v_j, w_i, w_j, k, c, backlash):
    """The force along the tangent t in the pitch point, by its arms; none within the play."""
    slides = sub(add(v_i, cross(w_i, arm_i)), add(v_j, cross(w_j, arm_j)))
    play = 0.5 * backlash
    pressed = k * (delta - play * sign(delta)) + c * dot(t, slides)
    return where(magnitude(delta) < play, 0.0, pressed)


def play_of(delta, backlash):
    """The distances of both flanks, which change their sign where they touch or part."""
    plays = backlash > 0.0
    return where(plays, delta - 0.5 * backlash, 1.0), where(plays, delta + 0.5 * backlash, 1.0)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GearMesh]
