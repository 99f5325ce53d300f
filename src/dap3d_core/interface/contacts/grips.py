"""Kernels of dry friction along one direction, whatever the load: it sticks, or slides against it.

Of the three rows of a contact (rows.py) the second alone is there, along a unit vector e, and holds
where it sticks. There is no gap: it is never open. mu and mu_s are the friction itself, N or N m.
The functions whose names begin with turning are of a moment about e.
"""

# Kernels take numbers of any kind: floats, and symbols of a trace.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from dap3d_core.interface.contacts.rows import (
    before_straying,
    closed,
    held,
    holds,
    rate,
    slip_of,
)
from dap3d_core.kernels import cross, dot, maximum, neg, row, scale, sub, where

_ZERO = (0.0, 0.0, 0.0)
_NONE = row(_ZERO, _ZERO)


def position():
    """C: there is no gap."""
    return 0.0


def blocks(c, e, r_i, r_j, mode, way):
    """J of both bodies."""
    u = where(holds(mode, way, 1), e, _ZERO)
    back = neg(u)
    return (
        (_NONE, row(u, cross(sub(c, r_i), u)), _NONE),
        (_NONE, row(back, cross(sub(c, r_j), back)), _NONE),
    )


def turning_blocks(e, mode, way):
    """J of both bodies."""
    u = where(holds(mode, way, 1), e, _ZERO)
    return (_NONE, row(_ZERO, u), _NONE), (_NONE, row(_ZERO, neg(u)), _NONE)


def gamma(c_dot, e, e_dot, c, r_i, v_i, w_i, r_j, v_j, w_j, mode, way):
    """-J_dot v."""
    slip = slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)
    bent = sub(cross(w_i, sub(c_dot, v_i)), cross(w_j, sub(c_dot, v_j)))
    return 0.0, where(holds(mode, way, 1), -dot(e_dot, slip) - dot(e, bent), 0.0), 0.0


def turning_gamma(e_dot, w_i, w_j, mode, way):
    """-J_dot v."""
    return 0.0, where(holds(mode, way, 1), -dot(e_dot, sub(w_i, w_j)), 0.0), 0.0


def sense(e, way):
    """+1 where it slides along e, -1 against it."""
    return where(dot(way, e) < 0.0, -1.0, 1.0)


def besides(e, mu, mode, way, near):
    """Friction on body i along e that the row does not give."""
    return where(held(mode), dot(near, e), where(closed(mode), -mu * sense(e, way), 0.0))


def whole(e, lam, mu, mode, way, near):
    """Friction on body i along e."""
    return besides(e, mu, mode, way, near) + where(held(mode), lam[1], 0.0)


def friction(c, e, r_i, r_j, mu, mode, way, near):
    """What acts besides the row."""
    F = scale(besides(e, mu, mode, way, near), e)
    return (F, cross(sub(c, r_i), F)), (neg(F), neg(cross(sub(c, r_j), F)))


def turning_friction(e, mu, mode, way, near):
    """What acts besides the row."""
    M = scale(besides(e, mu, mode, way, near), e)
    return (_ZERO, M), (_ZERO, neg(M))


def ends(speed, e, lam, mu, mu_s, mode, way, near, unit_mass):
    """What ends a mode where it is negative: nothing; slip, or the rest of what sticks."""
    size = whole(e, lam, mu, mode, way, near)
    sticks = where(mu_s > 0.0, (mu_s - maximum(size, -size)) / unit_mass, 1.0)
    sticks = before_straying(sticks, (0.0, speed, 0.0), way)
    slides = where(mu > 0.0, speed * sense(e, way), 1.0)
    return 1.0, where(held(mode), sticks, where(closed(mode), slides, 1.0))


def switch(c, e, r_i, v_i, w_i, r_j, v_j, w_j, lam, mu, mu_s, mode, way, near, unit_mass):
    """As ``ends``."""
    speed = dot(e, slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j))
    return ends(speed, e, lam, mu, mu_s, mode, way, near, unit_mass)


def turning_switch(e, w_i, w_j, lam, mu, mu_s, mode, way, near, unit_mass):
    """As ``ends``."""
    return ends(dot(e, sub(w_i, w_j)), e, lam, mu, mu_s, mode, way, near, unit_mass)


def output(c, e, r_i, v_i, w_i, r_j, v_j, w_j, lam, mu, mode, way, near):
    """As that of rows.py, without gap and normal force."""
    slip = scale(dot(e, slip_of(c, r_i, v_i, w_i, r_j, v_j, w_j)), e)
    F = scale(whole(e, lam, mu, mode, way, near), e)
    return (0.0, 0.0, *F, *slip, *c, 1.0, *F)


def turning_output(e, w_i, w_j, lam, mu, mode, way, near):
    """The same of a moment, N m, and an angular velocity."""
    slip = scale(dot(e, sub(w_i, w_j)), e)
    return (0.0, 0.0, *scale(whole(e, lam, mu, mode, way, near), e), *slip, *_ZERO, 1.0, *_ZERO)


KERNELS = {"C": position, "J": blocks, "gamma": gamma, "friction": friction, "switch": switch,
           "rate": rate, "tension": output}  # fmt: skip
TURNING = {"C": position, "J": turning_blocks, "gamma": turning_gamma, "rate": rate,
           "friction": turning_friction, "switch": turning_switch,
           "tension": turning_output}  # fmt: skip
