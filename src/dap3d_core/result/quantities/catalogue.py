"""What quantities there are: of a body, a point, a joint, a force, and of the whole."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import to_body
from dap3d_core.model.state_layout import split
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.point_motion import accelerations, point_motion

if TYPE_CHECKING:
    from dap3d_core.result.post.reactions import Reaction
    from dap3d_core.result.result import Result

AXES = ("x", "y", "z")
EULER = ("e0", "e1", "e2", "e3")
SLOTS = ("i", "j", "k")


class Owner(NamedTuple):
    """Whose quantity it is.

    Attributes:
        kind: "body", "point", "joint" or "force".
        name: its name.
        place: its place among those of its kind.
        slot: of a joint or a force the body slot that is meant, "" for the first.
    """

    kind: str
    name: str
    place: int
    slot: str = ""

    @property
    def shown(self) -> str:
        """The name, with the slot where one is meant."""
        return f"{self.name}.{self.slot}" if self.slot else self.name


class Kind(NamedTuple):
    """One kind of quantity.

    Attributes:
        words: what it is.
        unit: SI unit, "1" for none, "SI" where it depends on the row.
        components: names of the columns; empty for a number or for rows.
        values: (nt,) or (nt, components) of an owner.
        rate: the quantity that is its derivative in time, "" where none is.
    """

    words: str
    unit: str
    components: tuple[str, ...]
    values: "Callable[[Result, Owner], Floats]"
    rate: str = ""


def _body_axes(result: "Result", vectors: Floats, body: int) -> Floats:
    p = split(result.u)[1]
    return to_body(p[:, body], vectors[:, body])


def _point(level: int) -> "Callable[[Result, Owner], Floats]":
    def values(result: "Result", owner: Owner) -> Floats:
        places = np.array([owner.place])
        return point_motion(result.subject, result.u, result.v_dot, places, level)[:, 0]

    return values


def _action(part: str) -> "Callable[[Result, Owner], Floats]":
    """What a joint or a force exerts on the body of a slot."""

    def values(result: "Result", owner: Owner) -> Floats:
        found = getattr(_on(result, owner), part)
        if found is None:
            words = f"the type of the {owner.kind} {owner.name!r} has no point on that body"
            raise UnknownNameError(f"there is no {owner.shown}.{part}: {words}")
        return found  # type: ignore[no-any-return]

    return values


def _on(result: "Result", owner: Owner) -> "Reaction":
    joint = owner.kind == "joint"
    actions = result.reaction(owner.name) if joint else result.force(owner.name).on
    slot = owner.slot or next(iter(actions))
    if slot not in actions:
        raise UnknownNameError(
            f"the {owner.kind} {owner.name!r} has the slots {', '.join(actions)}, not {slot!r}"
        )
    return actions[slot]


def _of_element(part: str) -> "Callable[[Result, Owner], Floats]":
    """What a force element as a whole has, where its type has it."""

    def values(result: "Result", owner: Owner) -> Floats:
        found = getattr(result.force(owner.name), part)
        if found is None:
            raise UnknownNameError(f"the type of the force {owner.name!r} has no {part}")
        return found  # type: ignore[no-any-return]

    return values


def _multipliers(result: "Result", owner: Owner) -> Floats:
    start = result.subject.joint_start
    return result.Lam[:, start[owner.place] : start[owner.place + 1]]


BODY = {
    "r": Kind("position", "m", AXES, lambda s, o: s.r[:, o.place], "rd"),
    "p": Kind("Euler parameters", "1", EULER, lambda s, o: s.p[:, o.place]),
    "rd": Kind("velocity", "m/s", AXES, lambda s, o: s.rd[:, o.place], "rdd"),
    "w": Kind("angular velocity", "rad/s", AXES, lambda s, o: s.w[:, o.place], "wd"),
    "wp": Kind(
        "angular velocity in body axes",
        "rad/s",
        AXES,
        lambda s, o: _body_axes(s, s.w, o.place),
        "wpd",
    ),
    "rdd": Kind("acceleration", "m/s^2", AXES, lambda s, o: accelerations(s.v_dot)[0][:, o.place]),
    "wd": Kind(
        "angular acceleration", "rad/s^2", AXES, lambda s, o: accelerations(s.v_dot)[1][:, o.place]
    ),
    "wpd": Kind(
        "angular acceleration in body axes",
        "rad/s^2",
        AXES,
        lambda s, o: _body_axes(s, accelerations(s.v_dot)[1], o.place),
    ),
}
POINT = {
    "r": Kind("position", "m", AXES, _point(0), "v"),
    "v": Kind("velocity", "m/s", AXES, _point(1), "a"),
    "a": Kind("acceleration", "m/s^2", AXES, _point(2)),
}
#: What the arrays of points are called (spec 10): the point is meant where a body has its name.
POINT_ARRAYS = {"rP": "r", "rPd": "v", "rPdd": "a"}
#: Of each body slot: the part of a Reaction, what it is, its unit.
ACTIONS = {
    "force": ("force", "N"),
    "moment": ("moment", "N m"),
    "force_body": ("force in body axes", "N"),
    "moment_body": ("moment in body axes", "N m"),
    "moment_at_point": ("moment about its point", "N m"),
}
JOINT = {
    part: Kind(f"reaction {words}", unit, AXES, _action(part))
    for part, (words, unit) in ACTIONS.items()
} | {"lambda": Kind("Lagrange multipliers", "SI", (), _multipliers)}
FORCE = {
    part: Kind(words, unit, AXES, _action(part)) for part, (words, unit) in ACTIONS.items()
} | {
    "length": Kind("length", "m", (), _of_element("length"), "length_rate"),
    "length_rate": Kind("rate of the length", "m/s", (), _of_element("length_rate")),
    "tension": Kind("tension", "N", (), _of_element("tension")),
    "energy": Kind("potential energy", "J", (), _of_element("energy")),
}
KINDS = {"body": BODY, "point": POINT, "joint": JOINT, "force": FORCE}

#: Quantities of the whole: what it is, its unit, its values.
WHOLE: "dict[str, tuple[str, str, Callable[[Result], Floats]]]" = {
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
