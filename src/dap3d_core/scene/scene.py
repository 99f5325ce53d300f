"""The scene as described: bodies, points, vectors, elements and settings, by name, as written.

Values are stored as plain Python (arrays and lists become tuples); ``check`` validates them all.
"""

from pathlib import Path
from typing import Any

import attrs

from dap3d_core.registry.arguments import checked
from dap3d_core.scene.coerce import entry_of, keys_of, plain, with_identifiers
from dap3d_core.scene.contacts.tables import Collisions, ContactTables, Material
from dap3d_core.scene.display import SceneDisplay
from dap3d_core.scene.errors import Key, Mistake, MistakeList, SceneError

#: The newest version of the scene file that this program reads.
SCHEMA = 1
#: File names in a model's folder: its scene, and its own types.
SCENE_FILE, PLUGIN_FILE = "scene.toml", "plugin.py"
#: The body that is always there.
GROUND = "ground"

#: Values of ``method`` and ``integrator``: "auto", and names of formulations and integrators.
METHODS = ("auto", "unconstrained", "standard", "penalty", "lsq", "joint")
INTEGRATORS = ("auto", "dopri5", "dop853", "adams", "rk4", "radau", "moreau")
#: Values of ``start``: the initial conditions of the scene, or where it comes to rest.
STARTS = ("scene", "equilibrium")
#: Integrators without an error estimate, which need a step; integrators that take none.
FIXED_STEP, NO_STEP = ("rk4", "moreau"), ("adams",)
#: Values of ``contact``: how contacts are followed.
CONTACT_ENGINES = ("auto", "events", "stepping")

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
    """Settings of a run.

    Attributes:
        t_end: final time, s; None where the scene leaves it open.
        dt: reporting step, s; None where the scene leaves it open.
        method: formulation, or "auto".
        integrator: method of integration.
        rtol, atol: relative and absolute tolerance of a step; atol of all, or by quantity.
        step: step of an integrator with fixed steps, s, or None.
        correct: initial positions and velocities are corrected to satisfy the constraints.
        project: states are projected on the constraints during the run.
        hold: names of bodies that the correction does not move.
        start: "scene" or "equilibrium", where a run starts.
        correct_metric: "unit" or "mass", the norm of the least correction.
        contact: "events", "stepping" or "auto", how contacts are followed.
        contact_step: step of "stepping", s.
        alpha, Omega, mu: parameters of the penalty formulation.
    """

    t_end: Any = attrs.field(default=None, converter=plain)
    dt: Any = attrs.field(default=None, converter=plain)
    method: Any = attrs.field(default="auto", converter=plain)
    integrator: Any = attrs.field(default="dop853", converter=plain)
    rtol: Any = attrs.field(default=1e-8, converter=plain)
    atol: Any = attrs.field(default=None, converter=plain)
    step: Any = attrs.field(default=None, converter=plain)
    correct: Any = attrs.field(default=True, converter=plain)
    project: Any = attrs.field(default=True, converter=plain)
    hold: Any = attrs.field(default=(), converter=plain)
    correct_metric: Any = attrs.field(default="unit", converter=plain)
    start: Any = attrs.field(default="scene", converter=plain)
    contact: Any = attrs.field(default="auto", converter=plain)
    contact_step: Any = attrs.field(default=1e-3, converter=plain)
    alpha: Any = attrs.field(default=1e7, converter=plain)
    Omega: Any = attrs.field(default=10.0, converter=plain)
    mu: Any = attrs.field(default=1.0, converter=plain)


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
class Scene(SceneDisplay, ContactTables):
    """A mechanism and the settings of its simulation, as the user described them.

    Attributes:
        name, description: for people.
        schema: version of the file format.
        bodies, points, vectors, vectors2, joints, forces, functions: by name, in file order.
        inputs, shapes, materials, contacts: the same.
        requires: ranges of versions of the distributions that bring its types, by name.
        parameters: numbers by name, for expressions in place of numbers (text that begins with =).
        outputs: expressions of quantities, by name; or tables of ``value`` and ``unit``.
        collisions: which shapes that collide meet each other; None where the scene says nothing.
        animation, simulation: points to draw; settings of a run.
        path: the file this was read from, or None.
        faults: mistakes found in reading (unknown keys, wrong tables); ``check`` reports them.
        notes: information about the choice of the file.
        included: the files of its sub-assemblies, by their names.
    """

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
    path: Path | None = attrs.field(default=None, eq=False)
    faults: list[tuple[Key, Mistake]] = attrs.field(factory=list, eq=False)
    notes: list[str] = attrs.field(factory=list, eq=False)
    included: dict[str, Path] = attrs.field(factory=dict, eq=False)
    _counts: dict[str, int] = attrs.field(factory=dict, eq=False, init=False)

    @property
    def folder(self) -> Path | None:
        """The folder of the file this was read from, which may hold ``plugin.py``, or None."""
        return None if self.path is None else self.path.parent

    def copy(self) -> "Scene":
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
            **named,
        )
        scene._counts = dict(self._counts)
        return scene

    def resolved(self) -> "Scene":
        """A copy with numbers in place of expressions of parameters; itself without parameters.

        Raises:
            SceneError: all mistakes in parameters and expressions.
        """
        if not self.parameters:
            return self
        from dap3d_core.scene.expressions.parameters import resolve

        return resolve(self)

    def __deepcopy__(self, memo: Any) -> "Scene":
        """The same as ``copy``: values in a scene are plain and immutable."""
        return self.copy()

    def add_body(self, name: str, **fields: Any) -> str:
        """Add a body and return its name.

        Args:
            name: without dots, not ``ground``, not used by another body.
            fields: mass, Jp, r, p, r_dot, w, color, as in ``Body``.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("bodies", name, fields)

    def add_point(self, name: str, body: Any = None, sPp: Any = None, **unknown: Any) -> str:
        """Add a point fixed in a body at ``sPp`` (3 numbers in its axes, m) and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("points", name, {"body": body, "sPp": sPp} | unknown)

    def add_vector(self, name: str, body: Any = None, sp: Any = None, **unknown: Any) -> str:
        """Add a vector fixed in a body (3 components in its axes) and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("vectors", name, {"body": body, "sp": sp} | unknown)

    def add_vector2(self, name: str, P_i: Any = None, P_j: Any = None, **unknown: Any) -> str:
        """Add a vector from point ``P_i`` to point ``P_j`` and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("vectors2", name, {"P_i": P_i, "P_j": P_j} | unknown)

    def add_joint(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a joint of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("joints", type, name, fields)

    def add_force(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a force element of a type (its keyword) and return its name, made from it if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("forces", type, name, fields)

    def add_function(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a function of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("functions", type, name, fields)

    def add_input(self, name: str, value: Any = 0.0, **unknown: Any) -> str:
        """Add an input, a number that a controller or a script sets, and return its name.

        Args:
            name: a word, also the name of the quantity in results.
            value: at the start of a run.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("inputs", name, {"value": value} | unknown)

    def add_shape(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a shape (box, sphere, capsule, cylinder, plane, cone, disk, line, mesh); its name.

        It is drawn; with ``collides=True`` one of the first five meets others that do.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("shapes", type, name, fields)

    @checked
    def add_requirement(self, name: str, versions: str = "*") -> str:
        """Add a distribution that brings types of the scene, and return its name.

        Args:
            name: what pip installs, such as ``dap3d-example``.
            versions: a range of versions, such as ``">=0.2, <1"``; ``"*"`` is any. It is checked
                with the whole scene.
        """
        self.requires[plain(name)] = plain(versions)
        return name

    def add_parameter(self, name: str, value: float | str) -> str:
        """Add a parameter, a number that expressions such as ``"= L / 2"`` name; returns its name.

        Args:
            name: a word, not used by another parameter.
            value: a number, or an expression of other parameters: ``"= 2 * L"``.

        Raises:
            SceneError: the name is taken or illegal.
        """
        name = plain(name)
        self._check_name("parameters", self.parameters, name)
        self.parameters[name] = plain(value)
        return name

    def add_output(self, name: str, expression: str, unit: str | None = None) -> str:
        """Add an output, a quantity of results, and return its name.

        Args:
            name: a word, not used by another output.
            expression: of quantities, such as ``"0.5 * (left.r.z + right.r.z)"``; it is parsed with
                the check of the whole scene.
            unit: of its value, such as ``"deg"``; left out, as the expression has it.

        Raises:
            SceneError: the name is taken or illegal.
        """
        name = plain(name)
        self._check_name("outputs", self.outputs, name)
        value = plain(expression)
        self.outputs[name] = value if unit is None else {"value": value, "unit": plain(unit)}
        return name

    def add_animation_point(self, body: str, sPp: Any) -> None:
        """Add a point that is only drawn, at ``sPp`` (3 numbers in the axes of a body, m)."""
        self.animation.points.append(AnimationPoint(body, sPp))

    def to_toml(self) -> str:
        """The scene as the text of a scene file; reading it gives an equal scene.

        Raises:
            SceneError: it holds something that a scene file cannot.
        """
        from dap3d_core.scene.files.write_toml import to_toml

        return to_toml(self)

    @checked
    def save(self, path: str | Path) -> Path:
        """Write the scene to a file, or to ``scene.toml`` in a folder; returns the file.

        Raises:
            SceneError: it cannot be written.
        """
        from dap3d_core.scene.files.write_toml import save

        return save(self, path)

    def _add(self, table: str, name: str, fields: dict[str, Any]) -> str:
        named, class_ = getattr(self, table), NAMED[table]
        name, fields = plain(name), {k.rstrip("_"): plain(v) for k, v in fields.items()}
        self._check_name(table, named, name)
        if not fields.keys() <= keys_of(class_):
            mistakes = MistakeList()
            mistakes.add_unknown_keys((table, name), fields, keys_of(class_))
            mistakes.raise_mistakes()
        named[name] = entry_of(class_, name, {k: v for k, v in fields.items() if v is not None})
        return name

    def _add_element(self, table: str, type_: Any, name: str | None, fields: dict[str, Any]) -> str:
        elements = getattr(self, table)
        type_ = plain(type_)
        if type(type_) is not str or not type_:
            what = 'the type of an element is the keyword of a type, such as "sph"'
            raise SceneError([Mistake(f"{table}.{name or ''}".rstrip("."), type_, what)])
        if name is None:
            name = self._free_name(table, elements, type_)
        name = plain(name)
        self._check_name(table, elements, name)
        fields = {k: plain(v) for k, v in with_identifiers(fields).items() if v is not None}
        elements[name] = Element(name, type_, fields)
        return name

    def _free_name(self, table: str, elements: dict[str, Element], type_: str) -> str:
        count = self._counts.get(f"{table}.{type_}", 0) + 1
        while f"{type_}{count}" in elements:
            count += 1
        self._counts[f"{table}.{type_}"] = count
        return f"{type_}{count}"

    @staticmethod
    def _check_name(table: str, taken: dict[str, Any], name: Any) -> None:
        fault = fault_of_name(name)
        if not fault and name in taken:
            fault = f"there is one of this name in {table} already"
        if fault:
            raise SceneError([Mistake(table, name, f"not a name for one of the {table}: {fault}")])


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
