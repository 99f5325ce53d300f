"""Quantities of a result by name, as plots and tables ask for them: ``crank.r.z``."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.kinematics import split, to_body
from dap3d_core.registry.spelling import nearest
from dap3d_core.result.errors import LISTED, UnknownNameError
from dap3d_core.result.motion import accelerations, point_motion

if TYPE_CHECKING:
    from dap3d_core.result.result import Result
    from dap3d_core.result.subject import Subject

AXES = ("x", "y", "z")
EULER = ("e0", "e1", "e2", "e3")
NORM = "norm"


class Quantity(NamedTuple):
    """A quantity over the reported instants.

    Attributes:
        name: as it was asked for.
        values: (nt,), or (nt, components).
        kind: what it is, without whose: "velocity".
        label: what it is in words: "velocity of crank, z".
        unit: SI unit, "1" for none, "SI" where it depends on the row.
        components: names of the columns; empty for (nt,).
    """

    name: str
    values: Floats
    kind: str
    label: str
    unit: str
    components: tuple[str, ...]


class _Kind(NamedTuple):
    words: str
    unit: str
    components: tuple[str, ...]
    values: "Callable[[Result, int], Floats]"


def _body_axes(result: "Result", vectors: Floats, body: int) -> Floats:
    p = split(result.u, result.subject.body_count)[1]
    return to_body(p[:, body], vectors[:, body])


def _point(level: int) -> "Callable[[Result, int], Floats]":
    def values(result: "Result", point: int) -> Floats:
        places = np.array([point])
        return point_motion(result.subject, result.u, result.v_dot, places, level)[:, 0]

    return values


def _reaction(part: str) -> "Callable[[Result, int], Floats]":
    def values(result: "Result", joint: int) -> Floats:
        first = next(iter(result.reaction(result.subject.joint_names[joint]).values()))
        return getattr(first, part)  # type: ignore[no-any-return]

    return values


def _multipliers(result: "Result", joint: int) -> Floats:
    start = result.subject.joint_start
    return result.Lam[:, start[joint] : start[joint + 1]]


_BODY = {
    "r": _Kind("position", "m", AXES, lambda s, b: s.r[:, b]),
    "p": _Kind("Euler parameters", "1", EULER, lambda s, b: s.p[:, b]),
    "rd": _Kind("velocity", "m/s", AXES, lambda s, b: s.rd[:, b]),
    "w": _Kind("angular velocity", "rad/s", AXES, lambda s, b: s.w[:, b]),
    "wp": _Kind("angular velocity in body axes", "rad/s", AXES, lambda s, b: _body_axes(s, s.w, b)),
    "rdd": _Kind("acceleration", "m/s^2", AXES, lambda s, b: accelerations(s.v_dot)[0][:, b]),
    "wd": _Kind(
        "angular acceleration", "rad/s^2", AXES, lambda s, b: accelerations(s.v_dot)[1][:, b]
    ),
    "wpd": _Kind(
        "angular acceleration in body axes",
        "rad/s^2",
        AXES,
        lambda s, b: _body_axes(s, accelerations(s.v_dot)[1], b),
    ),
}
_POINT = {
    "r": _Kind("position", "m", AXES, _point(0)),
    "v": _Kind("velocity", "m/s", AXES, _point(1)),
    "a": _Kind("acceleration", "m/s^2", AXES, _point(2)),
}
_JOINT = {
    "force": _Kind("reaction force", "N", AXES, _reaction("force")),
    "moment": _Kind("reaction moment", "N m", AXES, _reaction("moment")),
    "lambda": _Kind("Lagrange multipliers", "SI", (), _multipliers),
}
_WHOLE: "dict[str, tuple[str, str, Callable[[Result], Floats]]]" = {
    "t": ("time", "s", lambda s: s.t),
    "energy.kinetic": ("kinetic energy", "J", lambda s: s.energy.kinetic),
    "energy.potential": ("potential energy", "J", lambda s: s.energy.potential),
    "energy.total": ("total energy", "J", lambda s: s.energy.total),
    "work": ("work of forces and drivers", "J", lambda s: s.work),
    "constraint.position": ("constraint residual", "SI", lambda s: s.arrays.position_residual),
    "constraint.velocity": (
        "velocity constraint residual",
        "SI",
        lambda s: s.arrays.velocity_residual,
    ),
    "constraint.acceleration": (
        "acceleration constraint residual",
        "SI",
        lambda s: s.arrays.acceleration_residual,
    ),
}
_KINDS = {"body": _BODY, "point": _POINT, "joint": _JOINT}


def find(result: "Result", name: str) -> Quantity:
    """A quantity of a result.

    A whole vector, ``crank.r``; a component, ``crank.r.z``; or its length, ``crank.r.norm``. Where
    a body and a point share a name, the body is meant unless only the point has the quantity.

    Args:
        result: whose quantity.
        name: ``BODY.`` r p rd w wp rdd wd wpd; ``POINT.`` r v a; ``JOINT.`` force moment (on the
            body of its first slot) lambda (rows from 1); energy.kinetic .potential .total; work;
            constraint.position .velocity .acceleration; t.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
    """
    if name in _WHOLE:
        words, unit, of = _WHOLE[name]
        return Quantity(name, of(result), words, words, unit, ())
    for kind, place, owner, attribute, component in _readings(result.subject, name):
        meant = _KINDS[kind].get(attribute)
        if meant is None:
            continue
        columns = _components(result.subject, kind, place, attribute)
        label = f"{meant.words} of {owner}"
        if not component:
            values = meant.values(result, place)
            return Quantity(name, values, meant.words, label, meant.unit, columns)
        label = f"{label}, {component}"
        if component == NORM and meant.components is AXES:
            values = np.linalg.norm(meant.values(result, place), axis=1)
        elif component in columns:
            values = meant.values(result, place)[:, columns.index(component)]
        else:
            continue
        return Quantity(name, values, meant.words, label, meant.unit, ())
    raise _unknown(result.subject, name)


def _components(subject: "Subject", kind: str, place: int, attribute: str) -> tuple[str, ...]:
    if attribute == "lambda" and kind == "joint":
        return tuple(str(k + 1) for k in range(subject.joint_rows[place]))
    return _KINDS[kind][attribute].components


def _places(subject: "Subject") -> dict[str, Mapping[str, int]]:
    return {
        "body": subject.body_index,
        "point": subject.point_index,
        "joint": subject.joint_index,
    }


def _readings(subject: "Subject", name: str) -> list[tuple[str, int, str, str, str]]:
    """Ways to read a name as (kind, place, owner, attribute, component or "")."""
    parts = name.split(".")
    found = []
    for tail in (2, 1)[len(parts) < 3 :]:
        owner = ".".join(parts[:-tail])
        attribute, component = parts[-tail], parts[-1] if tail == 2 else ""
        for kind, places in _places(subject).items():
            if owner in places:
                found.append((kind, places[owner], owner, attribute, component))
    return found


def _unknown(subject: "Subject", name: str) -> UnknownNameError:
    """What is wrong with a name: its owner, its attribute or its component."""
    parts = name.split(".")
    for size in (2, 1):  # an animation point has a dot in its name
        owner = ".".join(parts[:size])
        for kind, places in _places(subject).items():
            if owner in places:
                words = _fault(subject, kind, places[owner], owner, parts[size:])
                return UnknownNameError(words, _mended(subject, owner, parts[size:]))
    whole = nearest(name, _WHOLE)
    heads = [w for w in _WHOLE if w.startswith(f"{parts[0]}.")]
    if heads or len(parts) == 1:
        choices = heads or ["BODY.r", "BODY.w.z", "POINT.v", "JOINT.force.norm", *_WHOLE]
        words = f"there is no quantity {name!r}; there are {', '.join(choices)}"
        return UnknownNameError(words, whole)
    size = 2 if parts[0] == "animation" and len(parts) > 2 else 1
    given = ".".join(parts[:size])
    names = {kind: tuple(places) for kind, places in _places(subject).items()}
    words = f"there is no body, point or joint {given!r}"
    owner = nearest(given, [n for of_kind in names.values() for n in of_kind])
    if not owner and sum(map(len, names.values())) <= LISTED:
        words += "".join(f"; {kind}: {', '.join(known)}" for kind, known in names.items() if known)
    return UnknownNameError(words, _mended(subject, owner, parts[size:]))


def _fault(subject: "Subject", kind: str, place: int, owner: str, rest: list[str]) -> str:
    attributes = _KINDS[kind]
    if not rest:
        return f"which quantity of the {kind} {owner!r}: {', '.join(attributes)}"
    if rest[0] not in attributes:
        return f"the {kind} {owner!r} has {', '.join(attributes)}, not {rest[0]!r}"
    columns = _parts(subject, kind, place, rest[0])
    return f"{owner}.{rest[0]} has {', '.join(columns)}, not {'.'.join(rest[1:])!r}"


def _mended(subject: "Subject", owner: str, rest: list[str]) -> str:
    """The nearest right name of a quantity of an owner, or ""."""
    if not rest:
        return ""
    for kind, places in _places(subject).items():
        attribute = nearest(rest[0], _KINDS[kind]) if owner in places else ""
        if attribute:
            columns = _parts(subject, kind, places[owner], attribute)
            component = nearest(rest[1], columns) if len(rest) > 1 else ""
            return ".".join([owner, attribute, *([component] if component else [])])
    return ""


def _parts(subject: "Subject", kind: str, place: int, attribute: str) -> tuple[str, ...]:
    """What may stand after an attribute."""
    columns = _components(subject, kind, place, attribute)
    return (*columns, NORM) if _KINDS[kind][attribute].components is AXES else columns
