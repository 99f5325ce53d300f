"""Reads joints, forces and functions: from fields as written to the values their types need."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import attrs

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.scene.errors import MISSING, Key, dotted, shown
from dap3d_core.scene.tables import GROUND, ZERO, Element
from dap3d_core.scene.validate.coerce_values import (
    READERS,
    Fault,
    in_words,
    unread,
    unusual_value_note,
)
from dap3d_core.scene.validate.geometry import (
    BAD,
    Geometry,
    Located,
    body_index_of,
    entry_of,
    missing_words,
    named_row,
    point_of,
    two_ends,
    vector_of,
)
from dap3d_core.scene.validate.joint_fields import keys_beside_fields, with_joint_fields
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.types import Types, completed_type
from dap3d_core.scene.validate.validated_scene import Instance, arguments_of

#: Keys of a table's elements that are read before their fields.
ADDED_KEYS = {"contacts": ("material",)}
#: The two points that may be given in place of a vector of type 2.
ENDS = ("P_i", "P_j")

_ABSENT: Any = object()
#: Body of a slot that no field has given yet.
_UNKNOWN = -2


@attrs.frozen
class _Field:
    """A field of a type: name, properties, index of its slot (-1: none), reader, value reader."""

    name: str
    spec: FieldSpec
    slot: int
    read: Callable[["_Reading", "_Field", Any], None]
    value_of: Callable[[Any], Any]


class Reader:
    """Reads the elements of one type.

    Args:
        type_info: the type.
        table: joints, forces or functions.
        geometry: resolves references to points, vectors and bodies.
        report: takes mistakes and notes.
        arguments: how many each function of the scene takes, as far as known.
        known: the type of a kind and keyword, if there is one.
    """

    def __init__(
        self,
        type_info: TypeInfo,
        table: str,
        geometry: Geometry,
        report: Collector,
        arguments: Mapping[str, int],
        known: Callable[[str, Any], TypeInfo | None],
    ) -> None:
        self.known_type = known
        self.type_info, self.table = type_info, table
        self.geometry, self.report, self.arguments = geometry, report, arguments
        self.body_names = (GROUND, *geometry.bodies.body_names)
        self.slots = () if acts_on_all(type_info.type) else type_info.layout.slots
        self.function_index = {name: k for k, name in enumerate(report.scene.functions, 1)}
        #: Rows of F: those of functions, then those of inputs.
        self.rows = {
            "function": self.function_index,
            "input": {
                n: k for k, n in enumerate(report.scene.inputs, 1 + len(self.function_index))
            },
        }
        specs = {n: s for n, s in specs_of(type_info.type).items() if s.given}
        takes_ends = ENDS[0] not in specs and any(s.kind == "vector2" for s in specs.values())
        self.ends = ENDS if takes_ends else ()
        self.fields = [self._field(name, spec) for name, spec in specs.items()]
        self.kinds = {name: spec.kind for name, spec in specs.items()}
        self.lists = {name: spec for name, spec in specs.items() if spec.size}
        self.known = dict.fromkeys([*specs, *self.ends, *keys_beside_fields(type_info.type)])
        self.of_joints = {name: spec for name, spec in specs.items() if spec.gives}
        # Bodies and points that may be left out follow from the other fields of their slot.
        self.late = [
            f for f in self.fields if f.spec.kind in ("body", "point") and f.spec.default is None
        ]

    def _field(self, name: str, spec: FieldSpec) -> _Field:
        letter = slot_of(name)
        slot = self.slots.index(letter) if letter in self.slots else -1
        read = _FIELD_READERS.get(spec.kind, _Reading.value)
        return _Field(name, spec, slot, read, partial(READERS.get(spec.kind, unread), spec))

    def read(self, element: Element) -> Instance | None:
        """The instance of an element; None where a mistake was reported."""
        if self.of_joints and not self.of_joints.keys().isdisjoint(element.fields):
            whole = with_joint_fields(
                self.report, self.geometry, self.table, element, self.of_joints, self.lists,
                self.known_type,
            )  # fmt: skip
            if whole is None:
                return None
            element = whole
        reading = _Reading(self, element)
        if not element.fields.keys() <= self.known.keys():
            allowed = (*self.known, *ADDED_KEYS.get(self.table, ()))
            reading.report.add_unknown_keys(
                reading.key, element.fields, allowed, in_order=True, remedy=self.other_kind
            )
            reading.good = False
        for field in self.fields:
            value = element.fields.get(field.name, _ABSENT)
            if value is _ABSENT and not (self.ends and field.spec.kind == "vector2"):
                if field.spec.required:
                    reading.refuse(field.name, f"is required{in_words(field.spec)}")
                    continue
                value = field.spec.default
            field.read(reading, field, value)
        reading.check_slots()
        shape = reading.shape() if self.lists and reading.good else None
        if not reading.good:
            return None
        values, bodies = reading.values, tuple(reading.bodies)
        for field in self.late:
            if values[field.name] is None:
                is_point = field.spec.kind == "point"
                values[field.name] = ZERO if is_point else self.body_names[bodies[field.slot]]
        type_info = self.type_info
        if type_info.variants:
            type_info = type_info.chosen(values, reading.named)
            own = specs_of(type_info.type)  # with those of states that the variant has
            added = own.keys() - specs_of(self.type_info.type).keys()
            values |= {name: own[name].default for name in added}
        if shape is not None:
            completed = completed_type(type_info, shape, partial(reading.refuse, ""))
            if completed is None:
                return None
            type_info, bodies = completed, tuple(reading.bodies)
        functions = tuple([reading.rows.get(name, 0) for name in type_info.layout.functions])
        others = tuple([reading.others[name] for name in type_info.layout.others])
        return Instance(element.name, type_info, bodies, functions, values, others, element.fields)

    def other_kind(self, field: str) -> str:
        """Where an unknown field is one of the type of the other kind with the same keyword."""
        keyword = self.type_info.type.keyword
        for kind in {"joint", "force"} - {self.type_info.type.kind}:
            other = self.known_type(kind, keyword)
            if other is not None and field in specs_of(other.type):
                return f"the {kind} {keyword} has it: [{kind}s.NAME]"
        return ""


class _Reading:
    """One element: values of its fields, the body of each slot and the field that gave it."""

    __slots__ = ("bodies", "element", "given_by", "good", "key", "others", "places", "reader",
                 "report", "rows", "values")  # fmt: skip

    def __init__(self, reader: Reader, element: Element) -> None:
        count = len(reader.slots)
        self.reader, self.report, self.element = reader, reader.report, element
        self.key: Key = (reader.table, element.name)
        self.values: dict[str, Any] = {}
        self.bodies, self.given_by = [_UNKNOWN] * count, [""] * count
        self.others: dict[str, int] = {}  # bodies of vectors of no slot
        self.places: dict[str, Sequence[Located]] = {}  # of the entries of lists
        self.rows: dict[str, int] = {}  # of F, of fields that name functions and inputs
        self.good = True

    @property
    def named(self) -> dict[str, str]:
        """Fields that name functions or inputs, whose rows follow those of functions."""
        count = len(self.reader.function_index)
        return {n: "input" if row > count else "function" for n, row in self.rows.items()}

    def refuse(self, name: str, what: str, nearest: str = "", remedy: str = "") -> None:
        """Report a mistake of a field, or of the element where the name is empty."""
        key = (*self.key, name) if name else self.key
        self.report.add(key, self.element.fields.get(name, MISSING), what, nearest, remedy)
        self.good = False

    # ---------------------------------------------------------------- fields, by kind

    def body(self, field: _Field, value: Any) -> None:
        self.values[field.name] = value
        if value is not None:
            index = self.reader.geometry.bodies.body_index
            body = body_index_of(self.report, index, (*self.key, field.name), value)
            self.set_body(field.name, field.slot, body)

    def point(self, field: _Field, value: Any) -> None:
        geometry = self.reader.geometry
        located = geometry.points.get(value) if type(value) is str else None
        if located is None and value is not None:
            located = point_of(self.report, geometry, (*self.key, field.name), value)
        self.located(field, value, located)

    def vector(self, field: _Field, value: Any) -> None:
        located = None
        if value is not None:
            key, unit = (*self.key, field.name), field.spec.unit_length
            located = vector_of(self.report, self.reader.geometry, key, value, unit=unit)
        self.located(field, value, located)

    def located(self, field: _Field, value: Any, located: Located | None) -> None:
        """Store a point or a vector; None was left out, or reported where a value is given."""
        if located is None:
            self.values[field.name] = None
            self.good &= value is None
            return
        body, self.values[field.name] = located
        if field.spec.ground and body > 0:
            what = f"is on {self.reader.body_names[body]}; it is to be a vector of ground"
            self.refuse(field.name, what)
        elif field.slot < 0 and field.spec.kind == "vector" and not field.spec.ground:
            self.others[field.name] = body
        self.set_body(field.name, field.slot, body)

    def vector2(self, field: _Field, value: Any) -> None:
        """A vector between two points, by its name or by the two points."""
        fields, reader = self.element.fields, self.reader
        given = [end for end in reader.ends if end in fields]
        ends = None
        if value is not _ABSENT and given:
            self.refuse(field.name, f"give {field.name} or P_i and P_j, not both")
        elif value is not _ABSENT or not reader.ends:
            ends = self.declared_ends(field, value)
        elif given:
            P_i, P_j = fields.get("P_i"), fields.get("P_j")
            ends = two_ends(self.report, reader.geometry, self.key, P_i, P_j)
        else:
            self.refuse(
                field.name, f"is required, by name or by its ends P_i and P_j{in_words(field.spec)}"
            )
        if ends is None:
            self.good = False
            return
        for end, (body, local) in zip(ENDS, ends, strict=True):
            self.values[end] = local
            if (letter := end[-1]) in reader.slots:
                self.set_body(end if given else field.name, reader.slots.index(letter), body)

    def declared_ends(self, field: _Field, value: Any) -> Any:
        geometry = self.reader.geometry
        if isinstance(value, str) and value in geometry.vectors2:
            return geometry.vectors2[value]
        what, near, remedy = missing_words(
            self.report, "vector between two points", value, geometry.vectors2
        )
        if isinstance(value, str) and value in geometry.vectors:
            remedy = f"{value} is a vector of one body; {field.name} is one of [vectors2]"
        self.refuse(field.name, what, near, remedy)
        return None

    def function(self, field: _Field, value: Any) -> None:
        self.name_of(field, value, self.reader.function_index)
        self.check_arguments(field, value)

    def check_arguments(self, field: _Field, value: Any) -> None:
        """A function takes as many arguments as the field gives it."""
        count = self.reader.arguments.get(value) if isinstance(value, str) else None
        if count is not None and count != field.spec.arguments:
            given = field.spec.argument or "time"
            self.refuse(field.name, f"takes {counted(count)}, and is to be a function of {given}")

    def functions(self, field: _Field, value: Any) -> None:
        """Several functions by name."""
        declared = self.reader.function_index
        self.values[field.name] = value
        if type(value) is not tuple or not value:
            remedy = f'write {field.name} = ["{value}"]' if value in declared else ""
            self.refuse(field.name, "should be a list of names of functions", remedy=remedy)
            return
        for name in value:
            if not (isinstance(name, str) and name in declared):
                self.refuse(field.name, *missing_words(self.report, "function", name, declared))

    def input(self, field: _Field, value: Any) -> None:
        self.refuse_both(field, value)
        is_function = isinstance(value, str) and value in self.reader.function_index
        remedy = f"{value} is a function, not one of [inputs]" if is_function else ""
        self.name_of(field, value, self.report.scene.inputs, remedy)

    def joint(self, field: _Field, value: Any) -> None:
        self.name_of(field, value, self.report.scene.joints)

    def name_of(
        self, field: _Field, value: Any, declared: dict[str, Any], remedy: str = ""
    ) -> None:
        self.values[field.name] = value
        if isinstance(value, str) and field.spec.kind in self.reader.rows:
            self.rows[field.name] = self.reader.rows[field.spec.kind].get(value, 0)
        if value is not None and not (isinstance(value, str) and value in declared):
            words, near, other = missing_words(self.report, field.spec.kind, value, declared)
            self.refuse(field.name, words, near, other or remedy)

    def value(self, field: _Field, value: Any) -> None:
        """A number, a list of numbers, a matrix or a word."""
        spec = field.spec
        if (value is None and spec.default is None) or (spec.size and value is spec.default):
            self.values[field.name] = value
            return
        self.refuse_both(field, value)
        if spec.by_name and type(value) is str:
            row = named_row(self.report, spec, value, self.reader.rows, field.value_of)
            if isinstance(row, Fault):
                self.refuse(field.name, row.what, row.nearest, row.remedy)
            elif row is not None:
                self.values[field.name], self.rows[field.name] = 0.0, row
                self.check_arguments(field, value)
            if row is not None:
                return
        key = (*self.key, field.name)
        result = self.report.read(key, value, field.value_of)
        self.values[field.name] = result
        if isinstance(result, Fault):
            self.good = False
        elif odd := unusual_value_note(spec, result):
            self.report.note(f"{dotted(key)} = {shown(value)} {odd}")

    def refuse_both(self, field: _Field, value: Any) -> None:
        """Refuse a field of which another takes the place."""
        for other in field.spec.instead_of if value is not None else ():
            if self.element.fields.get(other) is not None:
                self.refuse(field.name, f"give {other} or {field.name}, not both")

    def list(self, field: _Field, value: Any) -> None:
        """A list of points, vectors or bodies by name."""
        self.values[field.name] = value
        kind, least = field.spec.kind, field.spec.least
        if type(value) is not tuple or len(value) < least:
            return self.refuse(field.name, f"should be a list of {least} or more {kind}, by name")
        key, geometry = (*self.key, field.name), self.reader.geometry
        places = [entry_of(self.report, geometry, key, kind, name) for name in value]
        self.good &= None not in places
        self.places[field.name] = places
        bodies = [place[0] for place in places if place is not None]
        if field.spec.apart and len(set(bodies)) < len(bodies):
            twice = next(body for k, body in enumerate(bodies) if body in bodies[:k])
            on = self.reader.body_names[twice]
            self.refuse(field.name, f"has two {kind} on {on}; each is to be on a body of its own")

    def shape(self) -> Any:
        """The lengths of the lists and the slots of their entries, whose values become fields."""
        from dap3d_core.interface.examine.sized_types import Shape, entry_fields, shared_slots

        sizes: dict[str, tuple[int, str]] = {}
        given = {n: v for n in self.reader.lists if isinstance(v := self.values[n], tuple)}
        for name, value in given.items():
            count, first = sizes.setdefault(self.reader.lists[name].size, (len(value), name))
            if count != len(value):
                what = f"has {len(value)} entries, and {first} has {count}: they go together"
                self.refuse(name, what)
        for name, spec in self.reader.lists.items():
            if name not in given:  # a default, one number
                self.values[name] = (float(spec.default),) * sizes[spec.size][0]
        on = {name: [body for body, _ in places] for name, places in self.places.items()}
        try:
            self.bodies, slots = shared_slots(self.bodies, on)
        except ValueError as error:
            self.refuse("", str(error))
            return None
        if on and len(self.bodies) < 2:
            name = self.reader.body_names[self.bodies[0]]
            self.refuse(next(iter(on)), f"all are on {name}; an element acts between bodies")
        for name, letters in slots.items():
            for entry, (_, local) in zip(
                entry_fields(name, letters), self.places[name], strict=True
            ):
                self.values[entry] = local
        constants = {n: self.values[n] for n, s in self.reader.lists.items() if s.constant}
        counts = {n: k for n, (k, _) in sizes.items()}
        return Shape(*(tuple(part.items()) for part in (counts, slots, constants)))

    # ---------------------------------------------------------------- bodies of slots

    def set_body(self, name: str, slot: int, body: int) -> None:
        """Set the body of a slot, as a field gives it; all fields of a slot must agree."""
        if body == BAD:
            self.good = False
        elif slot >= 0:
            if self.bodies[slot] == _UNKNOWN:
                self.bodies[slot], self.given_by[slot] = body, name
            elif self.bodies[slot] != body:
                self.report_conflict(name, slot, body)

    def check_slots(self) -> None:
        """The bodies of an element are known and different, and one of them is not ground."""
        bodies, slots, names = self.bodies, self.reader.slots, self.reader.body_names
        if not bodies:
            return
        if _UNKNOWN not in bodies:
            self.check_others()
        if min(bodies) >= 0 < max(bodies) and len(set(bodies)) == len(bodies):
            return  # nearly all elements
        if self.good and _UNKNOWN in bodies:
            letter = slots[bodies.index(_UNKNOWN)]
            fields = [f.name for f in self.reader.fields if slot_of(f.name) == letter]
            self.refuse("", f"which body is {letter}? Give {' or '.join(fields)}")
        if bodies == [0] and not self.reader.lists:
            what = "the only body of this element is ground, which is fixed"
            self.refuse(self.given_by[0], what)
        for n, body in enumerate(bodies):
            first = bodies.index(body)
            if body >= 0 and first < n:
                what = f"body {slots[first]} and body {slots[n]} are both {names[body]}"
                remedy = "an element acts between different bodies"
                self.refuse(self.given_by[n], what, remedy=remedy)

    def check_others(self) -> None:
        """Vectors of no slot are fixed in one of the element's bodies."""
        names = self.reader.body_names
        for name, body in self.others.items():
            if body != BAD and body not in self.bodies:
                allowed = " or ".join(names[b] for b in self.bodies)
                self.refuse(name, f"is on {names[body]}; it is to be a vector of {allowed}")

    def report_conflict(self, name: str, slot: int, body: int) -> None:
        letter, first = self.reader.slots[slot], self.given_by[slot]
        names = self.reader.body_names
        here, there = names[body], names[self.bodies[slot]]
        what = f"{name} is on {here}, but {first} on {there}: all of _{letter} is on one body"
        remedy = ""
        if first not in self.element.fields and first not in self.reader.ends:
            what = f"{name} is on {here}, but {first}, which is not given, is {there}"
            remedy = f'write {first} = "{here}", or take {name} on {there}'
        self.refuse(name, what, remedy=remedy)


_FIELD_READERS = {
    "body": _Reading.body,
    "point": _Reading.point,
    "vector": _Reading.vector,
    "vector2": _Reading.vector2,
    "function": _Reading.function,
    "functions": _Reading.functions,
    "input": _Reading.input,
    "joint": _Reading.joint,
    "points": _Reading.list,
    "vectors": _Reading.list,
    "bodies": _Reading.list,
}


def counted(count: int) -> str:
    """A number of arguments, in words."""
    return "one argument" if count == 1 else "two arguments"


def read_elements(
    report: Collector,
    geometry: Geometry,
    table: str,
    types: Types,
    functions: Sequence[Instance] = (),
    elements: Mapping[str, Element] | None = None,
) -> list[Instance]:
    """The elements of a table that are without mistakes, in file order.

    Args:
        report: takes mistakes and notes; its scene is read.
        geometry: resolves references.
        table: joints, forces, functions or contacts.
        types: loads the types of the scene.
        functions: of the scene, for those that name them.
        elements: in place of those of the scene's table, by name.
    """
    arguments = arguments_of(functions)
    elements = elements or getattr(report.scene, table)
    readers = {
        keyword: Reader(type_info, table, geometry, report, arguments, types.known)
        for keyword, type_info in types.of(table, elements).items()
    }
    read = (
        readers[element.type].read(element)
        for element in elements.values()
        if type(element.type) is str and element.type in readers
    )
    return [instance for instance in read if instance is not None]
