"""Sub-assemblies: the parts of one scene in another, at a place of their own, as NAME/PART.

Inputs, outputs and parameters are words of expressions, so they become NAME_WORD. What belongs to a
scene as a whole (its settings, forces such as gravity that name no part) is not taken over.
"""

import os
import re
from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry import UnknownTypeError, load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.errors import MISSING, Key, MistakeList, dotted
from dap3d_core.scene.expressions.expression import fault_of_word
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import (
    ACTIVE,
    GROUND,
    NAMED,
    NO_TURN,
    ZERO,
    Element,
    Point,
    Vector,
    fault_of_name,
)
from dap3d_core.scene.validate.coerce_values import (
    Fault,
    angle_of,
    from_axis_angle,
    from_rpy,
    numbers_of,
    quaternion_of,
)
from dap3d_core.scene.validate.shapes import SHAPES

#: How an orientation is given, and what makes Euler parameters of it.
ORIENTATIONS: Mapping[str, Callable[[Any], Any]] = {
    "p": quaternion_of,
    "rpy": from_rpy,
    "axis_angle": from_axis_angle,
}
PLACE = ("r", *ORIENTATIONS)
#: Suffixes of names that stand for the origin and the axes of a body.
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
#: Entries of a rotation matrix below this are rounding, as of a turn of 90 deg.
ROTATION_ROUNDING = 1e-15
#: Elements whose type may take something from ground that is not written, and the kind of each.
KINDS = {"joints": "joint", "forces": "force", "contacts": "contact"}
#: The field of a constant orientation A_i^T A_j, which is another one where ground is turned.
RELATIVE = "A_c"
#: A name in an expression: quoted, or a dotted word.
_NAMES = re.compile(r"""'[^']*'|"[^"]*"|(?<![\w.])[^\W\d]\w*(?:\.\w+)*""")


@checked
def include(
    scene: Scene,
    name: str,
    part: Scene,
    at: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Add the parts of a scene to another, as NAME/PART.

    Args:
        scene: takes them.
        name: a word, the name of the sub-assembly.
        part: a scene, which stays as it is.
        at: where its ground lies: ``r`` (3 numbers, m), and one of ``p``, ``rpy``, ``axis_angle``.
        parameters: numbers, or expressions of the parameters of ``scene``, for parameters of
            ``part``.

    Raises:
        SceneError: all mistakes in the arguments, and names that are taken.
    """
    mistakes = MistakeList()
    added = included(mistakes, ("include", name), part, at or {}, parameters or {})
    if added is not None:
        added.add_to(scene, mistakes)
    mistakes.raise_mistakes()


def included(
    mistakes: MistakeList, key: Key, part: Scene, at: Any, parameters: Any
) -> "_Part | None":
    """The parts of a scene under their new names; None where mistakes are reported."""
    name, before = str(key[-1]), len(mistakes.mistakes)
    if fault := fault_of_name(name) or fault_of_word(name):
        mistakes.add(key, name, f"not a name for a sub-assembly: {fault}")
    place = _place(mistakes, (*key, "at"), plain(at))
    given = plain(parameters)
    if not isinstance(given, dict):
        mistakes.add((*key, "parameters"), given, "should be a table such as {k = 2.0}")
    else:
        for word in given.keys() - part.parameters.keys():
            what = f"the scene has no such parameter; it has {', '.join(part.parameters) or 'none'}"
            near = mistakes.nearest(word, part.parameters)
            mistakes.add((*key, "parameters", word), given[word], what, near)
    if len(mistakes.mistakes) > before or place is None:
        return None
    return _Part(name, part.copy(), place, given)


@attrs.frozen(eq=False)
class _Place:
    """Where the ground of a sub-assembly lies: its rotation, its Euler parameters, its origin."""

    A: Floats
    p: tuple[float, ...]
    r: tuple[Any, ...]

    @property
    def is_turned(self) -> bool:
        return bool(np.any(np.eye(3) != self.A))

    @property
    def is_moved(self) -> bool:
        return self.is_turned or any(x != 0.0 for x in self.r)

    def position(self, x: Any) -> Any:
        """The coordinates in ground of a point; what is no list of three is left to the check."""
        turned = self.direction(x)
        if type(turned) is not tuple or len(turned) != 3:
            return turned
        return tuple(_sum([(1.0, a), (1.0, b)]) for a, b in zip(self.r, turned, strict=True))

    def direction(self, x: Any) -> Any:
        """The components in ground of a vector."""
        if type(x) is not tuple or len(x) != 3 or not self.is_turned:
            return x
        return tuple(_sum(list(zip(map(float, row), x, strict=True))) for row in self.A)

    def orientation(self, given: Mapping[str, Any]) -> Any:
        """Euler parameters behind the turn of the place, or a fault."""
        word = next((w for w in ("rpy", "axis_angle") if given.get(w) is not None), "p")
        p = ORIENTATIONS[word](given.get(word, NO_TURN))
        if isinstance(p, Fault) and word == "rpy":
            p = _quaternion(given[word]) or p
        if isinstance(p, Fault):
            return p
        e0, e1, e2, e3 = self.p
        left = ((e0, -e1, -e2, -e3), (e1, e0, -e3, e2), (e2, e3, e0, -e1), (e3, -e2, e1, e0))
        return tuple(_sum(list(zip(row, p, strict=True))) for row in left)


def _place(mistakes: MistakeList, key: Key, at: Any) -> _Place | None:
    if not isinstance(at, dict):
        mistakes.add(key, at, "should be a table such as {r = [0.0, 0.5, 0.0], rpy = [...]}")
        return None
    mistakes.add_unknown_keys(key, at, PLACE, in_order=True)
    words = [word for word in ORIENTATIONS if word in at]
    if len(words) > 1:
        mistakes.add(key, MISSING, f"give one of {' and '.join(words)}")
    r = at.get("r", ZERO)
    if type(r) is not tuple or len(r) != 3 or not all(map(_is_number, r)):
        numbers = numbers_of(r, 3)
        what = numbers.what if isinstance(numbers, Fault) else "should be a list of 3 numbers"
        mistakes.add((*key, "r"), r, what)
        r = ZERO
    p = ORIENTATIONS[words[0]](at[words[0]]) if words else NO_TURN
    if isinstance(p, Fault):
        given = at[words[0]]
        if type(given) is tuple and any(map(_is_expression, given)):
            p = Fault("takes numbers: expressions may move a sub-assembly, not turn it")
        mistakes.add((*key, words[0]), given, p.what, p.nearest, p.remedy)
        return None
    e0, e1, e2, e3 = p
    A = np.eye(3) + 2.0 * (
        e0 * np.array([[0, -e3, e2], [e3, 0, -e1], [-e2, e1, 0]])
        + np.array([[-e2 * e2 - e3 * e3, e1 * e2, e1 * e3],
                    [e1 * e2, -e1 * e1 - e3 * e3, e2 * e3],
                    [e1 * e3, e2 * e3, -e1 * e1 - e2 * e2]])
    )  # fmt: skip
    A[np.abs(A) < ROTATION_ROUNDING] = 0.0
    return _Place(A, p, r)


def _quaternion(rpy: Any) -> tuple[str, ...] | None:
    """Euler parameters, as expressions, of roll, pitch and yaw with expressions; None of others."""
    if type(rpy) is not tuple or len(rpy) != 3:
        return None
    angles = [x[1:].strip() if _is_expression(x) else angle_of(x) for x in rpy]
    if any(isinstance(x, Fault) for x in angles):
        return None
    (c0, s0), (c1, s1), (c2, s2) = ((f"cos(({x}) / 2)", f"sin(({x}) / 2)") for x in angles)
    return (
        f"= {c2} * {c1} * {c0} + {s2} * {s1} * {s0}",
        f"= {c2} * {c1} * {s0} - {s2} * {s1} * {c0}",
        f"= {c2} * {s1} * {c0} + {s2} * {c1} * {s0}",
        f"= {s2} * {c1} * {c0} - {c2} * {s1} * {s0}",
    )


def _is_number(x: Any) -> bool:
    return type(x) in (float, int) or _is_expression(x)


def _is_expression(x: Any) -> bool:
    return type(x) is str and x.startswith("=")


def _sum(terms: list[tuple[float, Any]]) -> Any:
    """The sum of factors times numbers or expressions; an expression where there is one."""
    terms = [(a, x) for a, x in terms if a != 0.0 and x != 0.0]
    if all(type(x) in (float, int) for _, x in terms):
        return float(sum(a * x for a, x in terms))
    if not all(_is_number(x) for _, x in terms):
        return next(x for _, x in terms if not _is_number(x))  # the check refuses it
    if len(terms) == 1 and terms[0][0] == 1.0:
        return terms[0][1]
    texts = [f"({x[1:].strip()})" if _is_expression(x) else f"({x!r})" for _, x in terms]
    factors = ["" if a == 1.0 else f"{a!r} * " for a, _ in terms]
    return "= " + " + ".join(f"{a}{x}" for a, x in zip(factors, texts, strict=True))


def _specs(kind: str, keyword: Any) -> Mapping[str, FieldSpec]:
    """The fields of an installed type; none where the check of the scene has to refuse it."""
    try:
        return specs_of(load_registry().get(kind, keyword).type)
    except (UnknownTypeError, PluginError, TypeError):
        return {}


class _Part:
    """The parts of a scene under the names that they have in another."""

    def __init__(self, name: str, part: Scene, place: _Place, parameters: dict[str, Any]) -> None:
        self.name, self.part, self.place, self.given = name, part, place, parameters
        tables = (getattr(part, table) for table in NAMED if table != "inputs")
        self.names = {n: f"{name}/{n}" for table in tables for n in table}
        self.words = {n: f"{name}_{n}" for n in (*part.inputs, *part.outputs)}
        self.parameters = {n: f"{name}_{n}" for n in part.parameters}
        self._axes_of_ground: dict[str, None] = {}
        self._left_out: list[str] = []

    def add_to(self, scene: Scene, mistakes: MistakeList) -> None:
        """Add all to a scene; names that are taken are mistakes."""
        for table in ("parameters", *NAMED, "outputs"):
            target = getattr(scene, table)
            for name, entry in self._entries(table, mistakes).items():
                if name in target:
                    what = f"the sub-assembly {self.name} has one of this name"
                    mistakes.add((table, name), MISSING, what)
                target[name] = entry
        for axis in self._axes_of_ground:
            name = self._name(f"{GROUND}.{axis}")
            if axis == "O":
                scene.points[name] = Point(name, GROUND, self.place.r)
            else:
                scene.vectors[name] = Vector(name, GROUND, self.place.direction(AXES[axis]))
        for point in self.part.animation.points:
            body, sPp = str(point.body), point.sPp
            sPp = self.place.position(sPp) if body == GROUND else sPp
            scene.animation.points.append(attrs.evolve(point, body=self._name(body), sPp=sPp))
        for name, versions in self.part.requires.items():
            both = {scene.requires.get(name, "*"), versions} - {"*"}
            scene.requires[name] = ", ".join(sorted(map(str, both))) or "*"
        if scene.folder and self.part.folder:
            self._find_meshes(scene, os.path.relpath(self.part.folder, scene.folder))
        file = self.part.path
        files = {f"{self.name}/{n}": other for n, other in self.part.included.items()}
        scene.included |= files | ({self.name: file} if file else {})
        scene.faults += [self._fault(key, mistake) for key, mistake in self.part.faults]
        scene.notes += [f"{self.name}: {note}" for note in self.part.notes]
        if self.part.collisions is not None:
            scene.notes.append(f"{self.name}: [collisions] left out; that of the whole scene holds")
        if self._left_out:
            scene.notes.append(
                f"{self.name}: {', '.join(self._left_out)} left out, which names no part of the "
                "sub-assembly and so acts on whole scenes"
            )

    def _entries(self, table: str, mistakes: MistakeList) -> dict[str, Any]:
        if table == "parameters":
            values = self.part.parameters
            own = {n: self._expression(v, self.parameters) for n, v in values.items()}
            return {self.parameters[n]: v for n, v in (own | self.given).items()}
        if table == "outputs":
            outputs = self.part.outputs
            return {self.words[n]: self._output(value) for n, value in outputs.items()}
        if table == "inputs":
            return {self.words[n]: attrs.evolve(x, name=self.words[n], value=self._value(x.value))
                    for n, x in self.part.inputs.items()}  # fmt: skip
        entries = {}
        for old, entry in getattr(self.part, table).items():
            name = self.names[old]
            if isinstance(entry, Element):
                fields = {k: self._output(v) if table == "joints" and k == ACTIVE else
                          self._field(k, v) for k, v in entry.fields.items()}  # fmt: skip
                if table == "forces" and not self._names_a_part(entry.fields):
                    self._left_out.append(old)
                    continue
                if table == "shapes" and fields.get("body") == GROUND and self.place.is_moved:
                    self._shape(entry.type, fields)
                if table in KINDS and self.place.is_moved:
                    self._write_out(_specs(KINDS[table], entry.type), entry.fields, fields)
                entries[name] = Element(name, entry.type, fields)
            else:
                given = attrs.asdict(entry, recurse=False)
                given = {f: v for f, v in given.items()
                         if v is not attrs.fields_dict(type(entry))[f].default}  # fmt: skip
                changed = {f: self._field(f, v) for f, v in given.items()}
                entries[name] = attrs.evolve(entry, **changed | {"name": name})
                self._put(mistakes, table, entries[name])
        return entries

    def _put(self, mistakes: MistakeList, table: str, entry: Any) -> None:
        """Bring a body, or a point or vector of ground, to its place."""
        place = self.place
        if table == "bodies":
            entry.r = place.position(entry.r)
            if entry.r_0 is not None:
                entry.r_0 = place.position(entry.r_0)
            for field in ("r_dot", "w"):
                if (value := getattr(entry, field)) is not ZERO:
                    setattr(entry, field, place.direction(value))
            if place.is_turned:
                p = place.orientation(attrs.asdict(entry, recurse=False))
                if isinstance(p, Fault):
                    what = f"is turned with the sub-assembly, which needs numbers or rpy: {p.what}"
                    mistakes.add((table, entry.name), MISSING, what)
                else:
                    entry.p, entry.rpy, entry.axis_angle = p, None, None
                if entry.p_0 is not None:
                    p = place.orientation({"p": entry.p_0})
                    entry.p_0 = entry.p_0 if isinstance(p, Fault) else p
        elif table == "points" and entry.body == GROUND:
            entry.sPp = place.position(entry.sPp)
        elif table == "vectors" and entry.body == GROUND:
            entry.sp = place.direction(entry.sp)

    def _shape(self, type_: Any, fields: dict[str, Any]) -> None:
        """Bring a shape of ground to its place."""
        known, put = SHAPES.get(type_, {"at": None, "p": None}), self.place
        if "at" in known:
            fields["at"] = put.position(fields.get("at", ZERO))
        if type(fields.get("points")) is tuple:
            fields["points"] = tuple(map(put.position, fields["points"]))
        if "axis" in known:
            fields["axis"] = put.direction(fields.get("axis", AXES["z"]))
        if "normal" in known:
            fields["normal"] = put.direction(fields.get("normal", AXES["z"]))
        if "p" in known and not isinstance(p := put.orientation(fields), Fault):
            fields["p"] = p

    def _write_out(
        self, specs: Mapping[str, FieldSpec], given: Mapping[str, Any], fields: dict[str, Any]
    ) -> None:
        """Write what an element takes from ground, by default or as components in its axes."""
        joints = [spec.gives for field, spec in specs.items() if spec.gives and field in given]
        for field, spec in specs.items():
            if spec.kind != "point" or spec.default is not None or field in given:
                continue
            taken = any(field in gives for gives in joints)
            if not taken and self._is_on_ground(specs, given, str(slot_of(field))):
                fields[field] = self._name(f"{GROUND}.O")
        for field, spec in specs.items():
            if spec.in_ground and field in fields:
                fields[field] = self.place.direction(fields[field])
        if RELATIVE in specs and self.place.is_turned:
            A = fields.get(RELATIVE, specs[RELATIVE].default)
            turned = self.place.direction
            if self._is_on_ground(specs, given, "j"):
                fields[RELATIVE] = tuple(map(turned, A))
            elif self._is_on_ground(specs, given, "i"):
                columns = map(turned, zip(*A, strict=True))
                fields[RELATIVE] = tuple(zip(*columns, strict=True))

    def _is_on_ground(
        self, specs: Mapping[str, FieldSpec], given: Mapping[str, Any], slot: str
    ) -> bool:
        """Whether a body of an element is ground, by what it names there."""
        ends = [self.part.vectors2[v] for v in given.values()
                if isinstance(v, str) and v in self.part.vectors2]  # fmt: skip
        values = {f"P_{slot}": getattr(end, f"P_{slot}", None) for end in ends} | dict(given)
        body = specs.get(f"body_{slot}")
        named = [value for field, value in values.items() if slot_of(field) == slot]
        if not named and body is not None:
            named = [body.default]
        return any(self._body_of(name) == GROUND for name in named)

    def _body_of(self, name: Any) -> Any:
        """The body of a point or vector, or the body itself."""
        if not isinstance(name, str):
            return None
        located = self.part.points.get(name) or self.part.vectors.get(name)
        return located.body if located else name.rpartition(".")[0] or name

    def _find_meshes(self, scene: Scene, way: str) -> None:
        """Name the files of meshes as seen from the folder of the other scene."""
        for old in self.part.shapes:
            fields = scene.shapes[self.names[old]].fields
            if way != "." and type(fields.get("file")) is str:
                fields["file"] = f"{way.replace(os.sep, '/')}/{fields['file']}"

    def _name(self, name: str) -> str:
        """The new name of a body, point, vector or element, or of an axis of one of them."""
        head, dot, tail = name.rpartition(".")
        if name in self.names:
            return self.names[name]
        if dot and head in self.names:
            return f"{self.names[head]}.{tail}"
        if head == GROUND and self.place.is_moved and tail in ("O", *AXES):
            self._axes_of_ground[tail] = None
            return f"{self.name}/{GROUND} {tail}"
        return name

    def _names_a_part(self, fields: Mapping[str, Any]) -> bool:
        values = [x for v in fields.values() for x in (v if type(v) is tuple else (v,))]
        return any(type(x) is str and (self._name(x) != x or x == GROUND) for x in values)

    def _field(self, field: str, value: Any) -> Any:
        is_input = type(value) is str and value in self.part.inputs
        if is_input and (field.startswith("input") or value not in self.names):
            return self.words[value]
        return self._value(value)

    def _value(self, value: Any) -> Any:
        if type(value) is tuple:
            return tuple(map(self._value, value))
        if type(value) is not str:
            return value
        return (
            self._expression(value, self.parameters) if _is_expression(value) else self._name(value)
        )

    def _expression(self, text: Any, words: Mapping[str, str]) -> Any:
        """An expression with other names of its parameters, inputs and outputs."""
        if type(text) is not str:
            return text
        return _NAMES.sub(lambda match: words.get(match[0], match[0]), text)

    def _output(self, output: Any) -> Any:
        if isinstance(output, dict):
            return output | {"value": self._output(output.get("value"))}
        if type(output) is not str:
            return output

        def renamed(match: re.Match[str]) -> str:
            head, dot, rest = match[0].strip("'\"").partition(".")
            if head in self.words:
                return self.words[head] + dot + rest
            return f"'{self.names[head]}{dot}{rest}'" if head in self.names else match[0]

        return _NAMES.sub(renamed, output)

    def _fault(self, key: Key, mistake: Any) -> Any:
        if len(key) > 1 and key[0] in NAMED:
            key = (key[0], f"{self.name}/{key[1]}", *key[2:])
        return key, attrs.evolve(mistake, key=dotted(key))
