"""Sub-assemblies: the parts of one scene in another, at a place of their own, as NAME/PART.

Inputs, outputs and parameters are words of expressions, so they become NAME_WORD. What belongs to a
scene as a whole (its settings, forces such as gravity that act on all bodies) is not taken over.
"""

import os
import re
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import attrs

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.registry import Registry, UnknownTypeError, load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.contacts.tables import Collisions, Material
from dap3d_core.scene.errors import MISSING, Key, MistakeList, dotted
from dap3d_core.scene.expressions.expression import fault_of_word
from dap3d_core.scene.place import Place, is_expression, read_place
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import (
    ACTIVE,
    GROUND,
    NAMED,
    ZERO,
    Element,
    Point,
    Vector,
    fault_of_name,
)
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.geometry import AXES
from dap3d_core.scene.validate.shapes import SHAPES
from dap3d_core.scene.validate.types import KINDS

#: The field of a constant orientation A_i^T A_j, which is another one where ground is turned.
RELATIVE = "A_c"
#: Kinds of fields of types that hold names, and the keys of other tables that do.
REFERENCES = frozenset({
    "body", "point", "vector", "vector2", "joint", "joint_fields", "function", "functions", "input",
    "points", "vectors", "bodies",
})  # fmt: skip
NAMES = ("body", "P_i", "P_j", "material")
#: Words of expressions of quantities that every scene has.
SYSTEM_WORDS = ("t", "work")
#: Ends of the names of contacts that limit a joint.
LIMIT_ENDS = ("_lower", "_upper")
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
    place = read_place(mistakes, (*key, "at"), plain(at))
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


class _Part:
    """The parts of a scene under the names that they have in another."""

    def __init__(self, name: str, part: Scene, place: Place, parameters: dict[str, Any]) -> None:
        self.name, self.part, self.place, self.given = name, part, place, parameters
        tables = (getattr(part, table) for table in NAMED if table != "inputs")
        self.names = {n: f"{name}/{n}" for table in tables for n in table}
        self.words = {n: f"{name}_{n}" for n in (*part.inputs, *part.outputs)}
        self._axes_of_ground: dict[str, None] = {}
        self._left_out: list[str] = []

    @cached_property
    def _registry(self) -> Registry:
        return load_registry()

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
            body, sPp = str(point.body), self._value(point.sPp)
            sPp = self.place.position(sPp) if body == GROUND else sPp
            scene.animation.points.append(attrs.evolve(point, body=self._name(body), sPp=sPp))
        for name, versions in self.part.requires.items():
            both = {scene.requires.get(name, "*"), versions} - {"*"}
            scene.requires[name] = ", ".join(sorted(map(str, both))) or "*"
        scene.files |= {f"{self.name}/{file}": path for file, path in self.part.files.items()}
        if scene.folder and self.part.folder:
            self._find_meshes(scene, os.path.relpath(self.part.folder, scene.folder))
        if self.part.collisions is not None and (pairs := self.part.collisions.exclude):
            whole, pairs = scene.collisions or Collisions(), self._value(pairs, is_name=True)
            scene.collisions = whole
            scene.add_collisions(whole.bodies, pairs, whole.material)
        file = self.part.path
        files = {f"{self.name}/{n}": other for n, other in self.part.included.items()}
        scene.included |= files | ({self.name: file} if file else {})
        scene.faults += [self._fault(key, mistake) for key, mistake in self.part.faults]
        scene.notes += [f"{self.name}: {note}" for note in self.part.notes]
        if self._left_out:
            scene.notes.append(
                f"{self.name}: {', '.join(self._left_out)} left out, which names no part of the "
                "sub-assembly and so acts on whole scenes"
            )

    def _entries(self, table: str, mistakes: MistakeList) -> dict[str, Any]:
        if table == "parameters":
            own = {n: self._value(v) for n, v in self.part.parameters.items()}
            return {f"{self.name}_{n}": v for n, v in (own | self.given).items()}
        if table == "outputs":
            return {self.words[n]: self._output(value) for n, value in self.part.outputs.items()}
        entries = {}
        for old, entry in getattr(self.part, table).items():
            name = self.words[old] if table == "inputs" else self.names[old]
            if not isinstance(entry, Element):
                entries[name] = self._other(mistakes, table, name, entry)
            elif (element := self._element(mistakes, table, name, entry)) is not None:
                entries[name] = element
        return entries

    def _other(self, mistakes: MistakeList, table: str, name: str, entry: Any) -> Any:
        """A body, point, vector, input or material under its new name, at its place."""
        given = attrs.asdict(entry, recurse=False)
        given = {f: v for f, v in given.items()
                 if v is not attrs.fields_dict(type(entry))[f].default}  # fmt: skip
        changed = {f: self._value(v, is_name=f in NAMES) for f, v in given.items()}
        if isinstance(entry, Material) and isinstance(entry.with_, dict):
            changed["with_"] = {
                self.names[other] if other in self.part.materials else other: self._value(pair)
                for other, pair in entry.with_.items()
            }
        entry = attrs.evolve(entry, **changed | {"name": name})
        self._put(mistakes, table, entry)
        return entry

    def _element(
        self, mistakes: MistakeList, table: str, name: str, entry: Element
    ) -> Element | None:
        """An element under its new name, at its place; None of a force on the whole scene."""
        type_info = self._type_of(table, entry.type)
        specs = specs_of(type_info.type) if type_info else {}
        if table == "forces" and self._acts_on_all(type_info, entry.fields):
            unknown = "" if type_info else f" (its type {entry.type!r} is not installed)"
            self._left_out.append(f"{entry.name}{unknown}")
            return None
        fields = {k: self._output(v) if table == "joints" and k == ACTIVE else
                  self._field(table, k, v, specs.get(k))
                  for k, v in entry.fields.items()}  # fmt: skip
        if table == "shapes":
            self._shape(entry.type, fields)
        elif type_info and self.place.is_moved:
            if refusal := self._refusal(type_info, entry.fields):
                mistakes.add((table, name), MISSING, refusal.what, remedy=refusal.remedy)
            self._write_out(specs, entry.fields, fields)
        return Element(name, entry.type, fields)

    def _type_of(self, table: str, keyword: Any) -> TypeInfo | None:
        """An installed type; None where there is none, or the check of the scene refuses it."""
        try:
            return self._registry.get(KINDS[table], keyword) if table in KINDS else None
        except (UnknownTypeError, PluginError, TypeError, AttributeError):
            return None

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
                p = self._turned(mistakes, entry, attrs.asdict(entry, recurse=False))
                if p is not None:
                    entry.p, entry.rpy, entry.axis_angle = p, None, None
                if entry.p_0 is not None:
                    entry.p_0 = self._turned(mistakes, entry, {"p": entry.p_0}) or entry.p_0
        elif table == "points" and entry.body == GROUND:
            entry.sPp = place.position(entry.sPp)
        elif table == "vectors" and entry.body == GROUND:
            entry.sp = place.direction(entry.sp)

    def _turned(self, mistakes: MistakeList, body: Any, given: Mapping[str, Any]) -> Any:
        """Euler parameters of a body turned with the place; None of what the check refuses."""
        p = self.place.orientation(given)
        if not isinstance(p, Fault):
            return p
        written = given.get("axis_angle")
        if type(written) is tuple and any(map(is_expression, written)):
            what = "is turned with the sub-assembly, and has expressions"
            key = ("bodies", body.name, "axis_angle")
            mistakes.add(key, written, what, remedy="give p or rpy, or numbers")
        return None

    def _shape(self, type_: Any, fields: dict[str, Any]) -> None:
        """Give a shape what [collisions] of the part says; bring one of ground to its place."""
        put, collisions = self.place, self.part.collisions
        if fields.get("collides") is True and collisions is not None:
            if collisions.material is not None:
                fields.setdefault("material", self._value(collisions.material, is_name=True))
            bodies = self._value(collisions.bodies, is_name=True)
            if type(bodies) is tuple and fields.get("body") not in bodies:
                fields["collides"] = False
        if type(file := fields.get("file")) is str and file in self.part.files:
            fields["file"] = f"{self.name}/{file}"
        if fields.get("body") != GROUND or not put.is_moved or type(type_) is not str:
            return
        known = SHAPES.get(type_, {"at": None, "p": None})
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

    def _refusal(self, type_info: TypeInfo, given: Mapping[str, Any]) -> Fault | None:
        """Why an element cannot follow where its ground is moved; None where it can."""
        along: Any = type_info.type.ground_axes
        named = str(given.get(along, f"{GROUND}.{along}"))
        vector = self.part.vectors.get(named)
        d = vector.sp if vector else AXES.get(named.rpartition(".")[2], ZERO)
        turned = along in AXES and self.place.direction(d) != d
        if along and (along is True or turned or self.place.moves_along(d)):
            what = (
                "measures from the ground of the whole scene, and does not follow the sub-assembly"
            )
            return Fault(what, "take a type that measures from a point of ground")
        slots = type_info.axis_slots if self.place.is_turned else ()
        if any(self._is_on_ground(specs_of(type_info.type), given, slot) for slot in slots):
            what = "lies by the axes of ground, which are not turned with the sub-assembly"
            return Fault(what, "name a body in place of ground, held there by a joint weld")
        return None

    def _write_out(
        self, specs: Mapping[str, FieldSpec], given: Mapping[str, Any], fields: dict[str, Any]
    ) -> None:
        """Write what an element takes from ground, by default or as components in its axes."""
        taken = {own for field, spec in specs.items() if field in given for own in spec.gives}
        for field, spec in specs.items():
            if spec.in_ground and spec.given and not spec.required:
                fields.setdefault(field, spec.default)
            if spec.in_ground and field in fields:
                fields[field] = self.place.direction(fields[field])
            if spec.kind not in ("point", "vector") or field in given or field in taken:
                continue
            if type(spec.default) is str:
                fields[field] = self._name(spec.default)
            elif spec.kind == "point" and self._is_on_ground(specs, given, str(slot_of(field))):
                fields[field] = self._name(f"{GROUND}.O")
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
        """Whether a body of an element is ground, by what it names there, or by default.

        slot: or a list of bodies.
        """
        if type(given.get(slot)) is tuple:
            return GROUND in given[slot]
        ends = [self.part.vectors2[v] for v in given.values()
                if isinstance(v, str) and v in self.part.vectors2]  # fmt: skip
        values = {f"P_{slot}": getattr(end, f"P_{slot}", None) for end in ends} | dict(given)
        named = [value for field, value in values.items() if slot_of(field) == slot]
        named = named or [spec.default for field, spec in specs.items() if slot_of(field) == slot]
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
            file = fields.get("file")
            if way != "." and type(file) is str and file not in scene.files:
                fields["file"] = f"{way.replace(os.sep, '/')}/{file}"

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

    def _acts_on_all(self, type_info: TypeInfo | None, fields: Mapping[str, Any]) -> bool:
        """Whether a force acts on whole scenes; of one that is not known, if it names no part."""
        if type_info:
            return bool(acts_on_all(type_info.type))
        values = [x for v in fields.values() for x in (v if type(v) is tuple else (v,))]
        return not any(type(x) is str and (self._name(x) != x or x == GROUND) for x in values)

    def _field(self, table: str, field: str, value: Any, spec: FieldSpec | None) -> Any:
        """The value of a field of an element, which may be a name, or an input: a word."""
        if table == "shapes":
            return self._value(value, is_name=field in NAMES)
        is_input = type(value) is str and value in self.part.inputs
        if spec is None:  # of no type that is known here
            is_input = is_input and value not in self.names
        elif spec.kind != "input":
            is_input = is_input and bool(spec.by_name) and value not in self.part.functions
        if is_input:
            return self.words[value]
        is_name = spec is None or spec.kind in REFERENCES or bool(spec.by_name)
        return self._value(value, is_name=is_name)

    def _value(self, value: Any, *, is_name: bool = False) -> Any:
        """A value with other names of parameters in its expressions; a name under its new one."""
        if type(value) is tuple:
            return tuple(self._value(x, is_name=is_name) for x in value)
        if isinstance(value, dict):
            return {key: self._value(x) for key, x in value.items()}
        if is_expression(value):
            return _NAMES.sub(lambda match: self._word(match[0]), value)
        return self._name(value) if is_name and type(value) is str else value

    def _word(self, written: str) -> str:
        """The new word for one of an expression; functions, constants and others stay."""
        word = written.strip("'\"")
        return written if fault_of_word(word) else f"{self.name}_{word}"

    def _output(self, output: Any) -> Any:
        if isinstance(output, dict):
            return output | {"value": self._output(output.get("value"))}
        if type(output) is not str:
            return output

        def renamed(match: re.Match[str]) -> str:
            head, dot, rest = match[0].strip("'\"").partition(".")
            if head in self.words:
                return self.words[head] + dot + rest
            if not dot:
                return head if head in SYSTEM_WORDS else self._word(match[0])
            owner = head.partition("#")[0]  # of a contact at several points, or a limit
            owners = (owner, *(owner.removesuffix(end) for end in LIMIT_ENDS))
            is_part = any(name in self.names for name in owners)
            return f"'{self.name}/{head}.{rest}'" if is_part else match[0]

        return _NAMES.sub(renamed, output)

    def _fault(self, key: Key, mistake: Any) -> Any:
        if len(key) > 1 and key[0] in NAMED:
            key = (key[0], f"{self.name}/{key[1]}", *key[2:])
        return key, attrs.evolve(mistake, key=dotted(key))
