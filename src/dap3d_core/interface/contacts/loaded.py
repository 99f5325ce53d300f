"""Kernels of the friction of a joint: it sticks, or slides, by the load that multipliers are.

Of the three rows of a contact (rows.py) those along a direction, in a plane, or all hold where it
sticks; axes has their unit vectors, zero where there is none, u is the slip. There is no gap: it is
never open. mu and mu_s are multiplied by the load; of moments they hold the radius. The functions
whose names begin with turning are of moments.
"""

# Kernels take numbers of any kind: floats, and symbols of a trace.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from collections.abc import Mapping, Sequence
from typing import Any

from dap3d_core.interface.contacts.grips import sense
from dap3d_core.interface.contacts.resistance import RESISTED
from dap3d_core.interface.contacts.rows import (
    across,
    before_straying,
    closed,
    direction,
    held,
    holds,
    rate,
    slip_of,
    tangent_rates,
    tangents,
    unit,
)
from dap3d_core.kernels import add, cross, dot, neg, row, scale, sqrt, sub, where

_ZERO = (0.0, 0.0, 0.0)


def line(e):
    """Rows along one direction; of its rate those of its rate."""
    return _ZERO, e, _ZERO


def plane(n):
    """Rows in the plane across n."""
    return (_ZERO, *tangents(n))


def plane_rates(n, n_dot):
    """Rates of ``plane``."""
    return (_ZERO, *tangent_rates(n, n_dot))


def every():
    """Rows along all axes."""
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def toward(e, way):
    """The direction in which it slides along e."""
    return scale(sense(e, way), e)


def size(lam):
    """The load of rows together."""
    square = 0.0
    for x in lam:
        square = square + x * x
    return where(square > 0.0, sqrt(where(square > 0.0, square, 1.0)), 0.0)


def pressed(lam):
    """The load of one row that pushes alone."""
    return where(lam[0] > 0.0, lam[0], 0.0)


def carried(lam, near, n):
    """The normal force that a contact presses with, with its share."""
    return lam[0] + dot(near, n)


def rolling(lengths):
    """Of lengths that resist that of rolling."""
    return lengths[0]


def spinning(lengths):
    """Of lengths that resist that of spinning."""
    return lengths[1]


FUNCTIONS: dict[str, Any] = {
    f"{f.__name__}__": f
    for f in (line, plane, plane_rates, every, toward, size, pressed, carried, rolling, spinning,
              direction, across, slip_of, sub)
}  # fmt: skip


def expressions(calls: Mapping[str, str], how: str) -> dict[str, str]:
    """Expressions for what kernels name here, from those of the declared functions.

    Args:
        calls: expressions of c, n, e and their rates, where they are declared, and of lengths.
        how: "push": the load is of one row, and none where that pulls; "roll", "spin": the normal
            force of a contact, which resists this.
    """
    bodies = [calls.get(name, name) for name in ("r_j", "v_j", "w_j")]
    u = f"sub__(w_i, {bodies[2]})"
    if "c" in calls:
        u = f"slip_of__({calls['c']}, r_i, v_i, w_i, {', '.join(bodies)})"
    found = {"u": u, "load": "pressed__(lam_load)" if how == "push" else "size__(lam_load)"}
    if how in RESISTED:
        n = calls["n"] if "n" in calls else calls["e"]
        mu = f"{RESISTED[how][1]}__({calls['resist']})"
        found |= {"load": f"carried__(lam_load, near_load, {n})", "mu": mu, "mu_s": mu}
    if "e" in calls:
        way = f"toward__({calls['e']}, way)"
        axes, rates = f"line__({calls['e']})", f"line__({calls['e_dot']})"
        return found | {"axes": axes, "axes_dot": rates, "ahead": way, "toward": way}
    if "n" in calls:
        n, both = calls["n"], f"{calls['n']}, {calls['n_dot']}"
        return found | {
            "axes": f"plane__({n})", "axes_dot": f"plane_rates__({both})",
            "ahead": f"direction__({u}, {n}, way)", "toward": f"across__(way, {n})",
        }  # fmt: skip
    none = "(0.0, 0.0, 0.0)"
    ahead = f"direction__({u}, {none}, way)"
    return found | {
        "axes": "every__()",
        "axes_dot": f"line__({none})",
        "ahead": ahead,
        "toward": "way",
    }


def needs(
    wanted: Mapping[str, Sequence[str]], calls: Mapping[str, str], how: str
) -> dict[str, list[str]]:
    """Names that the expressions take, from those that c, n, e and their rates take."""
    bodies = ["r_i", "v_i", "w_i", *(n for n in ("r_j", "v_j", "w_j") if n not in calls)]
    u = [*wanted.get("c", ()), *bodies] if "c" in calls else [n for n in bodies if n[0] == "w"]
    axis = [*wanted.get("e", ()), *wanted.get("n", ())]
    rates = [*axis, *wanted.get("e_dot", ()), *wanted.get("n_dot", ())]
    ahead = [*axis, "way"] if "e" in calls else [*u, *axis, "way"]
    found = {"u": u, "load": ["lam_load"], "axes": axis, "axes_dot": rates, "ahead": ahead,
             "toward": [*axis, "way"]}  # fmt: skip
    if how in RESISTED:
        found["mu"] = found["mu_s"] = list(wanted["resist"])
        found["load"] = ["lam_load", "near_load", *axis]
    return found


def holding(axes, mode, way):
    """The directions whose rows hold."""
    return tuple(where(holds(mode, way, k), e, _ZERO) for k, e in enumerate(axes))


def blocks(axes, c, r_i, r_j, mode, way):
    """J of both bodies."""
    on, s_i, s_j = holding(axes, mode, way), sub(c, r_i), sub(c, r_j)
    return (
        tuple(row(e, cross(s_i, e)) for e in on),
        tuple(row(neg(e), neg(cross(s_j, e))) for e in on),
    )


def turning_blocks(axes, mode, way):
    """J of both bodies."""
    on = holding(axes, mode, way)
    return tuple(row(_ZERO, e) for e in on), tuple(row(_ZERO, neg(e)) for e in on)


def gamma(axes, axes_dot, u, c_dot, v_i, w_i, v_j, w_j, mode, way):
    """-J_dot v."""
    bent = sub(cross(w_i, sub(c_dot, v_i)), cross(w_j, sub(c_dot, v_j)))
    return tuple(
        where(holds(mode, way, k), -dot(axes_dot[k], u) - dot(axes[k], bent), 0.0) for k in range(3)
    )


def turning_gamma(axes_dot, u, mode, way):
    """-J_dot v."""
    return tuple(where(holds(mode, way, k), -dot(axes_dot[k], u), 0.0) for k in range(3))


def projected(axes, vector):
    """The part of a vector along the rows."""
    x, y, z = (scale(dot(e, vector), e) for e in axes)
    return add(add(x, y), z)


def besides(axes, ahead, load, mu, mode, near):
    """Friction on body i that the rows do not give."""
    slides = where(closed(mode), scale(-mu * load, ahead), _ZERO)
    return where(held(mode), projected(axes, near), slides)


def whole(axes, ahead, lam, load, mu, mode, near):
    """Friction on body i."""
    x, y, z = (scale(where(held(mode), part, 0.0), e) for part, e in zip(lam, axes, strict=True))
    return add(besides(axes, ahead, load, mu, mode, near), add(add(x, y), z))


def friction(axes, ahead, c, r_i, r_j, load, mu, mode, near):
    """What acts besides the rows."""
    F = besides(axes, ahead, load, mu, mode, near)
    return (F, cross(sub(c, r_i), F)), (neg(F), neg(cross(sub(c, r_j), F)))


def turning_friction(axes, ahead, load, mu, mode, near):
    """What acts besides the rows."""
    M = besides(axes, ahead, load, mu, mode, near)
    return (_ZERO, M), (_ZERO, neg(M))


def switch(axes, u, ahead, toward, lam, load, mu, mu_s, mode, way, near, unit_mass):
    """What ends a mode where it is negative: nothing; slip, or the rest of the cone."""
    T = whole(axes, ahead, lam, load, mu, mode, near)
    sticks = where(mu_s > 0.0, (mu_s * load - sqrt(dot(T, T))) / unit_mass, 1.0)
    slides = where(mu > 0.0, dot(u, unit(toward)), 1.0)
    sticks = before_straying(sticks, tuple(dot(u, e) for e in axes), way)
    return 1.0, where(held(mode), sticks, where(closed(mode), slides, 1.0))


def resisting_switch(axes, u, ahead, toward, lam, load, mu, mu_s, mode, way, near, unit_mass):
    """The same, or a length that becomes negative."""
    _, ends = switch(axes, u, ahead, toward, lam, load, mu, mu_s, mode, way, near, unit_mass)
    return 1.0, where(closed(mode) & (mu < 0.0), mu, ends)


def output(axes, u, ahead, c, lam, load, mu, mode, near):
    """As that of rows.py; the normal force is the load."""
    T = whole(axes, ahead, lam, load, mu, mode, near)
    return (0.0, load, *T, *projected(axes, u), *c, 1.0, *T)


def turning_output(axes, u, ahead, lam, load, mu, mode, near):
    """The same of a moment, N m, and an angular velocity."""
    T = whole(axes, ahead, lam, load, mu, mode, near)
    return (0.0, load, *T, *projected(axes, u), *_ZERO, 1.0, *_ZERO)


def resisting_output(axes, u, ahead, lam, load, mu, mu_s, mode, near):
    """The same, and coefficients as of a law of friction."""
    return (*turning_output(axes, u, ahead, lam, load, mu, mode, near), mu, mu, mu_s, mu_s)


KERNELS = {"J": blocks, "gamma": gamma, "friction": friction, "switch": switch,
           "rate": rate, "tension": output}  # fmt: skip
TURNING = {"J": turning_blocks, "gamma": turning_gamma, "rate": rate, "friction": turning_friction,
           "switch": switch, "tension": turning_output}  # fmt: skip
RESISTING = TURNING | {"switch": resisting_switch, "tension": resisting_output}


def kernels_of(
    calls: dict[str, str], wanted: dict[str, list[str]], every: dict[str, Any], *, how: str
) -> dict[str, Any]:
    """The kernels of the friction of a joint.

    Args:
        calls, wanted: expressions, and the names that they take, to which those of here are added.
        every: functions that expressions call; as well.
        how: as of ``expressions``.
    """
    wanted |= needs(wanted, calls, how)
    calls |= expressions(calls, how)
    every |= FUNCTIONS
    if how in RESISTED:
        return RESISTING
    return KERNELS if "c" in calls else TURNING
