"""Catalogue of quantities: name, components, unit, meaning and function of each.

Attributes of ``Result``, data sets, tables, and names for plots are made from it. Stored arrays are
listed in arrays.py, constants of the model in file/schema.py.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import roll_pitch_yaw, roll_pitch_yaw_rates, to_body
from dap3d_core.model.state_layout import split
from dap3d_core.result.arrays import AXES, COLUMNS, EULER, Arrays, ModelSummary
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.metadata import RunMetadata
from dap3d_core.result.post.contact_output import ContactOutput
from dap3d_core.result.post.force_output import ForceOutput, Reaction
from dap3d_core.result.post.point_motion import Energy, accelerations, point_motion

if TYPE_CHECKING:
    from dap3d_core.model import Model
    from dap3d_core.result.post.joint_coordinates import JointCoordinates
    from dap3d_core.scene.expressions.expression import Expression


class Quantity(NamedTuple):
    """A quantity over the reported instants.

    Attributes:
        name: as requested.
        values: (nt,), or (nt, components).
        kind: what it is, without its owner: "velocity".
        label: what it is in words: "velocity of crank, z".
        unit: SI unit, "1" for none, "SI" where it depends on the row; of an output as declared, ""
            where it is not known.
        components: names of the columns; empty for (nt,).
        owner: "body", "point", "joint", "force", "input" or "output"; "coordinate" for one of a
            joint, "state" for one of its own of a joint or a force; "" for one of the whole system.
        rate: name of the quantity that is its time derivative, "" for none.
        operands: names of the quantities that an output is computed from.
        exact: False where a number in an output may have a unit of its own.
    """

    name: str
    values: Floats
    kind: str
    label: str
    unit: str
    components: tuple[str, ...]
    owner: str = ""
    rate: str = ""
    operands: tuple[str, ...] = ()
    exact: bool = True

    @property
    def columns(self) -> tuple[str, ...]:
        """Name of each column, a quantity too: ``crank.r.x``, of points ``floor#1.gap``."""
        attribute = self.name.rpartition(".")[2]
        if self.owner == "contact" and self.components != AXES:
            return tuple(f"{point}.{attribute}" for point in self.components) or (self.name,)
        return tuple(f"{self.name}.{c}" for c in self.components) or (self.name,)


class QuantitySource(Protocol):
    """The part of a ``Result`` that quantities are computed from."""

    summary: ModelSummary
    arrays: Arrays
    record: RunMetadata

    @property
    def energy(self) -> Energy:
        """Energies of the system."""

    @property
    def model(self) -> "Model":
        """The model."""

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names of the force elements."""

    @property
    def outputs(self) -> Mapping[str, "Expression"]:
        """Outputs of the scene by name."""

    @property
    def output_cache(self) -> dict[str, "Quantity"]:
        """Outputs that are already evaluated."""

    def note(self, text: str, /) -> None:
        """Append a note."""

    def reaction(self, joint: str, /) -> Mapping[str, Reaction]:
        """Reactions of a joint by slot."""

    def coordinates(self, joint: str, /) -> "JointCoordinates":
        """Coordinates of a joint."""

    def force(self, name: str, /) -> ForceOutput:
        """Output of a force element."""

    def contact(self, name: str, /) -> ContactOutput:
        """Output of a contact."""


class QuantityOwner(NamedTuple):
    """The body, point, joint, contact or force that a quantity belongs to.

    Attributes:
        kind: "body", "point", "joint" or "force".
        name: its name.
        place: its index among those of its kind.
        slot: body slot of a joint or a force, "" for the first.
    """

    kind: str
    name: str
    place: int
    slot: str = ""

    @property
    def label(self) -> str:
        """The name, with the slot if there is one."""
        return f"{self.name}.{self.slot}" if self.slot else self.name


#: Values (nt,) or (nt, components) of an owner; (nt, k, components) of k bodies or points.
QuantityFunction = Callable[[QuantitySource, QuantityOwner], Floats]
MotionFunction = Callable[[QuantitySource, slice], Floats]


class QuantityType(NamedTuple):
    """A type of quantity.

    Attributes:
        label: what it is, such as "velocity".
        unit: SI unit, "1" for none, "SI" where it depends on the row.
        components: names of the columns; empty for a scalar or for rows.
        values: (nt,) or (nt, components) of an owner.
        rate: the quantity that is its time derivative, "" for none.
    """

    label: str
    unit: str
    components: tuple[str, ...]
    values: QuantityFunction
    rate: str = ""


class MotionArray(NamedTuple):
    """Motion of all bodies or points: an attribute of a result, and a quantity of each owner.

    Attributes:
        array: name of the attribute.
        quantity: name of the quantity of an owner.
        label, unit, components, rate: of that quantity.
        meaning: of the attribute.
        values: (nt, k, components) of k bodies or points.
        owner: "body" or "point".
    """

    array: str
    quantity: str
    label: str
    meaning: str
    unit: str
    values: MotionFunction
    rate: str = ""
    components: tuple[str, ...] = AXES
    owner: str = "body"

    @property
    def dimensions(self) -> tuple[str, str]:
        """Dimensions besides time."""
        return self.owner, "axis" if self.components is AXES else "euler"

    def quantity_type(self) -> QuantityType:
        """The quantity of one body or point."""

        def values(source: QuantitySource, owner: QuantityOwner) -> Floats:
            return self.values(source, slice(owner.place, owner.place + 1))[:, 0]

        return QuantityType(self.label, self.unit, self.components, values, self.rate)


def _state(part: int) -> MotionFunction:
    return lambda source, bodies: split(source.arrays.u)[part][:, bodies]


def _acceleration(part: int) -> MotionFunction:
    return lambda source, bodies: accelerations(source.arrays.v_dot)[part][:, bodies]


def _in_body_axes(vectors: MotionFunction) -> MotionFunction:
    return lambda source, bodies: to_body(_state(1)(source, bodies), vectors(source, bodies))


def _angle(place: int) -> QuantityFunction:
    """Roll, pitch or yaw; roll and yaw with whole turns.

    Between two instants an angle changes by what its rates at both make of the interval, to the
    nearest turn; by less than half a turn where the rates differ too much to say, as they do near
    a pitch of a quarter turn.
    """

    def values(source: QuantitySource, owner: QuantityOwner) -> Floats:
        body = slice(owner.place, owner.place + 1)
        angles = roll_pitch_yaw(_state(1)(source, body))[:, 0]
        rates = roll_pitch_yaw_rates(angles, _state(3)(source, body)[:, 0])[:, place]
        half = 0.5 * np.diff(source.arrays.t)
        agree = half * np.abs(rates[1:] - rates[:-1]) < np.pi
        changes = np.where(agree, half * (rates[1:] + rates[:-1]), 0.0)
        missing = (changes - np.diff(angles[:, place])) / (2.0 * np.pi)
        turns = np.concatenate([[0.0], np.cumsum(np.rint(missing))])
        return np.asarray(angles[:, place] + 2.0 * np.pi * turns)

    return values


def _points(level: int) -> MotionFunction:
    return lambda source, points: point_motion(
        source.summary, source.arrays.u, source.arrays.v_dot, points, level
    )


#: Arrays of the manual's post-processor.
MOTION = (
    MotionArray("r", "r", "position", "position of the mass centre", "m", _state(0), "rd"),
    MotionArray("p", "p", "Euler parameters", "Euler parameters, body to global", "1", _state(1),
                components=EULER),
    MotionArray("rd", "rd", "velocity", "velocity of the mass centre", "m/s", _state(2), "rdd"),
    MotionArray("w", "w", "angular velocity", "angular velocity, global axes", "rad/s", _state(3),
                "wd"),
    MotionArray("wp", "wp", "angular velocity in body axes", "angular velocity, body axes",
                "rad/s", _in_body_axes(_state(3)), "wpd"),
    MotionArray("rdd", "rdd", "acceleration", "acceleration of the mass centre", "m/s^2",
                _acceleration(0)),
    MotionArray("wd", "wd", "angular acceleration", "angular acceleration, global axes",
                "rad/s^2", _acceleration(1)),
    MotionArray("wpd", "wpd", "angular acceleration in body axes",
                "angular acceleration, body axes", "rad/s^2", _in_body_axes(_acceleration(1))),
    MotionArray("rP", "r", "position", "position of the point", "m", _points(0), "v",
                owner="point"),
    MotionArray("rPd", "v", "velocity", "velocity of the point", "m/s", _points(1), "a",
                owner="point"),
    MotionArray("rPdd", "a", "acceleration", "acceleration of the point", "m/s^2", _points(2),
                owner="point"),
)  # fmt: skip
#: Quantities of points by the names of their arrays, for points that share a body's name.
POINT_ARRAYS = {m.array: m.quantity for m in MOTION if m.owner == "point"}


def _action(part: str) -> QuantityFunction:
    """Part of the ``Reaction`` of a joint or a force on the body of a slot."""

    def values(source: QuantitySource, owner: QuantityOwner) -> Floats:
        is_joint = owner.kind == "joint"
        actions = source.reaction(owner.name) if is_joint else source.force(owner.name).on
        slot = owner.slot or next(iter(actions))
        if slot not in actions:
            raise UnknownNameError(
                f"the {owner.kind} {owner.name!r} has the slots {', '.join(actions)}, not {slot!r}"
            )
        action: Floats | None = getattr(actions[slot], part)
        if action is None:
            reason = f"the type of the {owner.kind} {owner.name!r} has no point on that body"
            raise UnknownNameError(f"there is no {owner.label}.{part}: {reason}")
        return action

    return values


def _force_output(part: str) -> QuantityFunction:
    """Part of the ``ForceOutput`` of a force element."""

    def values(source: QuantitySource, owner: QuantityOwner) -> Floats:
        output: Floats | None = getattr(source.force(owner.name), part)
        if output is None:
            raise UnknownNameError(f"the type of the force {owner.name!r} has no {part}")
        return output

    return values


def _actuation(source: QuantitySource, owner: QuantityOwner) -> Floats:
    """Force of an actuator, as inverse dynamics found it."""
    if owner.name not in source.record.actuation:
        raise UnknownNameError(
            f"the {owner.kind} {owner.name!r} has no actuation: the result is none of inverse "
            "dynamics in which it is an actuator"
        )
    return np.array(source.record.actuation[owner.name])


def _multipliers(source: QuantitySource, owner: QuantityOwner) -> Floats:
    start = source.summary.joint_start
    return source.arrays.Lam[:, start[owner.place] : start[owner.place + 1]]


#: Angles of a body, as ``rpy`` of a scene.
ANGLES = ("roll", "pitch", "yaw")
#: Parts of a ``Reaction``: label and unit.
ACTIONS = {
    "force": ("force", "N"),
    "moment": ("moment", "N m"),
    "force_body": ("force in body axes", "N"),
    "moment_body": ("moment in body axes", "N m"),
    "moment_at_point": ("moment about its point", "N m"),
}
#: Quantities by kind of their owner and by name.
QUANTITIES: dict[str, dict[str, QuantityType]] = {
    "body": {
        **{m.quantity: m.quantity_type() for m in MOTION if m.owner == "body"},
        **{name: QuantityType(name, "rad", (), _angle(k)) for k, name in enumerate(ANGLES)},
    },
    "point": {m.quantity: m.quantity_type() for m in MOTION if m.owner == "point"},
    "joint": {
        **{n: QuantityType(f"reaction {a}", u, AXES, _action(n)) for n, (a, u) in ACTIONS.items()},
        "lambda": QuantityType("Lagrange multipliers", "SI", (), _multipliers),
        "actuation": QuantityType("actuation", "SI", (), _actuation),
    },
    "force": {
        **{n: QuantityType(label, u, AXES, _action(n)) for n, (label, u) in ACTIONS.items()},
        "length": QuantityType("length", "m", (), _force_output("length"), "length_rate"),
        "length_rate": QuantityType("rate of the length", "m/s", (), _force_output("length_rate")),
        "tension": QuantityType("tension", "N", (), _force_output("tension")),
        "energy": QuantityType("potential energy", "J", (), _force_output("energy")),
        "actuation": QuantityType("actuation", "SI", (), _actuation),
    },
}


class SystemQuantity(NamedTuple):
    """A quantity (nt,) of the whole system: label, unit, function."""

    label: str
    unit: str
    values: Callable[[QuantitySource], Floats]


def _energy(part: str) -> SystemQuantity:
    return SystemQuantity(f"{part} energy", "J", lambda source: getattr(source.energy, part))


def _stored(label: str, column: str) -> SystemQuantity:
    unit = next(c.unit for c in COLUMNS if c.name == column)
    return SystemQuantity(label, unit, lambda source: getattr(source.arrays, column))


SYSTEM = {
    "t": _stored("time", "t"),
    "energy.kinetic": _energy("kinetic"),
    "energy.potential": _energy("potential"),
    "energy.total": _energy("total"),
    "work": _stored("work of forces and drivers", "work"),
    "constraint.position": _stored("constraint residual", "position_residual"),
    "constraint.velocity": _stored("velocity constraint residual", "velocity_residual"),
    "constraint.acceleration": _stored("acceleration constraint residual", "acceleration_residual"),
}
