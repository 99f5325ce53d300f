"""What a scene holds: bodies, points, vectors, elements and settings, by name, as written.

Values are stored as plain Python (arrays and lists become tuples); ``check`` validates them all.
"""

from pathlib import Path
from typing import Any, Self

import attrs

from dap3d_core.scene.coerce import plain
from dap3d_core.scene.contacts.tables import Collisions, Material
from dap3d_core.scene.errors import Key, Mistake
from dap3d_core.settings import SETTINGS

#: The newest version of the scene file that this program reads.
SCHEMA = 1
#: File names in a model's folder: its scene, and its own types.
SCENE_FILE, PLUGIN_FILE = "scene.toml", "plugin.py"
#: The body that is always there.
GROUND = "ground"

ZERO = (0.0, 0.0, 0.0)
NO_TURN = (1.0, 0.0, 0.0, 0.0)


@attrs.define
class Body:
    """A rigid body; its frame is at its mass centre.

    Attributes:
        name: its name in the scene.
        mass: kg; None where the scene gives none (1.0 is then used, with a note).
        Jp: inertia matrix in body axes, 3 numbers (its diagonal) or 3x3, kg m^2; None as for mass.
        r: position, 3 numbers, m.
        p: orientation as Euler parameters e0, e1, e2, e3, of unit length; or in their place
        rpy: roll, pitch, yaw: turns about ground's x, then y, then z, rad or such as "30 deg"; or
        axis_angle: an axis, 3 numbers of any length, and the angle about it.
        r_dot: velocity, 3 numbers, m/s.
        w: angular velocity in global axes, 3 numbers, rad/s.
        r_0, p_0: the reference pose: what types take from the poses of the scene, such as the
            zero of a joint's coordinate, is that of these; None for r and p.
        color: for drawings, "" for the next of the colour cycle.
    """

    name: str
    mass: Any = attrs.field(default=None, converter=plain)
    Jp: Any = attrs.field(default=None, converter=plain)
    r: Any = attrs.field(default=ZERO, converter=plain)
    p: Any = attrs.field(default=NO_TURN, converter=plain)
    rpy: Any = attrs.field(default=None, converter=plain)
    axis_angle: Any = attrs.field(default=None, converter=plain)
    r_dot: Any = attrs.field(default=ZERO, converter=plain)
    w: Any = attrs.field(default=ZERO, converter=plain)
    r_0: Any = attrs.field(default=None, converter=plain)
    p_0: Any = attrs.field(default=None, converter=plain)
    color: Any = ""


@attrs.define
class Point:
    """A point fixed in a body: name, name of the body, its coordinates there (3 numbers, m)."""

    name: str
    body: Any = None
    sPp: Any = attrs.field(default=None, converter=plain)


@attrs.define
class Vector:
    """A vector fixed in a body (type 1): name, name of the body, 3 components there."""

    name: str
    body: Any = None
    sp: Any = attrs.field(default=None, converter=plain)


@attrs.define
class Vector2:
    """A vector between two points (type 2): name, and the points it runs from and to."""

    name: str
    P_i: Any = None
    P_j: Any = None


@attrs.define
class Element:
    """A joint, force, function or shape: its name, the keyword of its type, its fields."""

    name: str
    type: Any = None
    fields: dict[str, Any] = attrs.Factory(dict)


@attrs.define
class Input:
    """A number that is set from outside: its name, its value at the start of a run."""

    name: str
    value: Any = attrs.field(default=0.0, converter=plain)


@attrs.define
class AnimationPoint:
    """A point that is only drawn: name of its body, its coordinates there (3 numbers, m)."""

    body: Any = attrs.field(default=None, converter=plain)
    sPp: Any = attrs.field(default=None, converter=plain)


@attrs.define
class Animation:
    """Drawing: points of bodies, and limits of the axes, 3 pairs (m), or None."""

    points: list[AnimationPoint] = attrs.Factory(list)
    limits: Any = attrs.field(default=None, converter=plain)


@attrs.define
class Simulation:
    """Settings of a run: what each is, its default and what is allowed stand in ``SETTINGS``."""

    t_end: Any = attrs.field(default=SETTINGS["t_end"].default, converter=plain)
    dt: Any = attrs.field(default=SETTINGS["dt"].default, converter=plain)
    method: Any = attrs.field(default=SETTINGS["method"].default, converter=plain)
    integrator: Any = attrs.field(default=SETTINGS["integrator"].default, converter=plain)
    rtol: Any = attrs.field(default=SETTINGS["rtol"].default, converter=plain)
    atol: Any = attrs.field(default=SETTINGS["atol"].default, converter=plain)
    step: Any = attrs.field(default=SETTINGS["step"].default, converter=plain)
    correct: Any = attrs.field(default=SETTINGS["correct"].default, converter=plain)
    project: Any = attrs.field(default=SETTINGS["project"].default, converter=plain)
    hold: Any = attrs.field(default=SETTINGS["hold"].default, converter=plain)
    correct_metric: Any = attrs.field(default=SETTINGS["correct_metric"].default, converter=plain)
    start: Any = attrs.field(default=SETTINGS["start"].default, converter=plain)
    contact: Any = attrs.field(default=SETTINGS["contact"].default, converter=plain)
    contact_step: Any = attrs.field(default=SETTINGS["contact_step"].default, converter=plain)
    alpha: Any = attrs.field(default=SETTINGS["alpha"].default, converter=plain)
    Omega: Any = attrs.field(default=SETTINGS["Omega"].default, converter=plain)
    mu: Any = attrs.field(default=SETTINGS["mu"].default, converter=plain)


#: Keys of joints whose coordinate a contact limits (contacts/read_contacts.py).
LIMITS = ("lower", "upper", "e")
#: Keys of joints that end where their force becomes larger, and that hold only while an expression
#: is positive (validate/joint_fields.py).
RELEASES = BREAKS_AT, ACTIVE = "breaks_at", "active"
HEADER_KEYS = frozenset({"name", "description", "schema"})
#: Tables of the scene file with named entries, and the class of an entry.
NAMED: dict[str, type] = {
    "bodies": Body,
    "points": Point,
    "vectors": Vector,
    "vectors2": Vector2,
    "joints": Element,
    "forces": Element,
    "functions": Element,
    "inputs": Input,
    "shapes": Element,
    "materials": Material,
    "contacts": Element,
}
TABLES = (
    "scene",
    "include",
    "requires",
    "parameters",
    *NAMED,
    "outputs",
    "collisions",
    "animation",
    "simulation",
)


@attrs.define(repr=False)
class SceneTables:
    """What a scene holds, by name, as written; ``Scene`` says what each is."""

    name: Any = ""
    description: Any = ""
    schema: Any = SCHEMA
    bodies: dict[str, Body] = attrs.Factory(dict)
    points: dict[str, Point] = attrs.Factory(dict)
    vectors: dict[str, Vector] = attrs.Factory(dict)
    vectors2: dict[str, Vector2] = attrs.Factory(dict)
    joints: dict[str, Element] = attrs.Factory(dict)
    forces: dict[str, Element] = attrs.Factory(dict)
    functions: dict[str, Element] = attrs.Factory(dict)
    inputs: dict[str, Input] = attrs.Factory(dict)
    shapes: dict[str, Element] = attrs.Factory(dict)
    materials: dict[str, Material] = attrs.Factory(dict)
    contacts: dict[str, Element] = attrs.Factory(dict)
    requires: dict[str, Any] = attrs.Factory(dict)
    parameters: dict[str, Any] = attrs.Factory(dict)
    outputs: dict[str, Any] = attrs.Factory(dict)
    collisions: Collisions | None = None
    animation: Animation = attrs.Factory(Animation)
    simulation: Simulation = attrs.Factory(Simulation)
    path: Path | None = attrs.field(
        default=None, converter=attrs.converters.optional(Path), eq=False
    )
    faults: list[tuple[Key, Mistake]] = attrs.field(factory=list, eq=False)
    notes: list[str] = attrs.field(factory=list, eq=False)
    included: dict[str, Path] = attrs.field(factory=dict, eq=False)
    files: dict[str, Path] = attrs.field(factory=dict, eq=False)
    _counts: dict[str, int] = attrs.field(factory=dict, eq=False, init=False)

    @property
    def folder(self) -> Path | None:
        """The folder of the file this was read from, which may hold ``plugin.py``, or None."""
        return None if self.path is None else self.path.parent

    def copy(self) -> Self:
        """An equal scene that shares nothing mutable with this one."""
        named: dict[str, Any] = {
            table: {name: _copied(part) for name, part in getattr(self, table).items()}
            for table in NAMED
        }
        points = [_copied(point) for point in self.animation.points]
        scene = attrs.evolve(
            self,
            animation=attrs.evolve(self.animation, points=points),
            simulation=_copied(self.simulation),
            requires=dict(self.requires),
            parameters=dict(self.parameters),
            outputs={name: plain(output) for name, output in self.outputs.items()},
            faults=list(self.faults),
            notes=list(self.notes),
            included=dict(self.included),
            files=dict(self.files),
            **named,
        )
        scene._counts = dict(self._counts)
        return scene

    def __deepcopy__(self, memo: Any) -> Self:
        """The same as ``copy``: values in a scene are plain and immutable."""
        return self.copy()


def _copied(part: Any) -> Any:
    """A copy of a part of a scene, whose values are plain."""
    if type(part) is Element and type(part.fields) is dict:
        return attrs.evolve(part, fields=dict(part.fields))
    return attrs.evolve(part)


def fault_of_name(name: Any) -> str:
    """The reason why something cannot name a part of a scene; "" where it can."""
    if type(name) is not str:
        return f"a name is text, not {type(name).__name__}"
    if not name.strip():
        return "a name is not empty"
    if name.strip().lower() == GROUND:
        return f"{GROUND} is always there and has no data of its own; take another name"
    if name != name.strip():
        return "a name neither begins nor ends with a space"
    if "." in name:
        return "a name holds no dot (NAME.O, NAME.x are the origin and axes of a body)"
    if not name.isprintable():
        return "a name holds no line breaks or other control characters"
    return ""
