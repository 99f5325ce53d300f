"""Joints, forces and functions: from the fields as written to what their type needs."""

from collections.abc import Callable, Iterable
from typing import Any

import attrs

from dap3d_core.interface.codegen.examined import Examined
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.errors import MISSING, Key, dotted, shown
from dap3d_core.scene.scene import GROUND, ZERO, Element, unknown_key
from dap3d_core.scene.validate.coerce_values import (
    Fault,
    bounded,
    list_of,
    matrix_of,
    number_of,
    numbers_of,
    word_of,
)
from dap3d_core.scene.validate.geometry import (
    BAD,
    Geometry,
    body_of,
    missing_words,
    point_of,
    two_ends,
    vector_of,
)
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Instance
from dap3d_core.scene.validate.warnings import oddity

#: The two points that may stand for a vector of type 2.
ENDS = ("P_i", "P_j")

_ABSENT: Any = object()
#: A slot whose body no field has told yet.
_UNKNOWN = -2


@attrs.frozen
class _Field:
    """A field of a type: its name, what it is, the place of its slot (-1: none), how it is read."""

    name: str
    spec: FieldSpec
    slot: int
    read: Callable[["_Field", Any, "_Work"], None]


@attrs.define
class _Work:
    """An element that is being read.

    What was found, which field told the body of each slot, and the bodies of vectors of no slot.
    """

    element: Element
    key: Key
    values: dict[str, Any]
    bodies: list[int]
    told_by: list[str]
    others: dict[str, int] = attrs.field(factory=dict)
    good: bool = True


class Reader:
    """Reads the elements of one type.

    Args:
        examined: the type.
        table: joints, forces or functions.
        geometry: where references to points, vectors and bodies lead.
        report: takes mistakes and notes.
    """

    def __init__(
        self, examined: Examined, table: str, geometry: Geometry, report: Collector
    ) -> None:
        self.examined, self.table = examined, table
        self.geometry, self.report = geometry, report
        self.body_names = (GROUND, *geometry.bodies.names)
        self.slots = () if getattr(examined.type, "each_body", False) else examined.layout.slots
        self.function_place = {name: k for k, name in enumerate(report.scene.functions, 1)}
        specs = {n: s for n, s in specs_of(examined.type).items() if s.given}
        takes_ends = ENDS[0] not in specs and any(s.kind == "vector2" for s in specs.values())
        self.ends = ENDS if takes_ends else ()
        self.fields = [self._field(name, spec) for name, spec in specs.items()]
        self.known = dict.fromkeys([*specs, *self.ends])
        # Bodies and points that may be left out follow from the other fields of their slot.
        self.late = [
            f for f in self.fields if f.spec.kind in ("body", "point") and f.spec.default is None
        ]

    def _field(self, name: str, spec: FieldSpec) -> _Field:
        letter = slot_of(name)
        slot = self.slots.index(letter) if letter in self.slots else -1
        readers = {
            "body": self._body,
            "point": self._point,
            "vector": self._vector,
            "vector2": self._vector2,
            "function": self._function,
            "joint": self._joint,
        }
        return _Field(name, spec, slot, readers.get(spec.kind, self._value))

    def read(self, element: Element) -> Instance | None:
        """What the type needs of an element; None where something is wrong (it is reported)."""
        given, count = element.fields, len(self.slots)
        work = _Work(element, (self.table, element.name), {}, [_UNKNOWN] * count, [""] * count)
        if not given.keys() <= self.known.keys():
            self._report_unknown(work)
        for field in self.fields:
            value = given.get(field.name, _ABSENT)
            if value is _ABSENT and not (self.ends and field.spec.kind == "vector2"):
                if field.spec.required:
                    self._report_missing(field, work)
                    continue
                value = field.spec.default
            field.read(field, value, work)
        self._check_slots(work)
        if not work.good:
            return None
        values, bodies = work.values, tuple(work.bodies)
        for field in self.late:
            if values[field.name] is None:
                is_point = field.spec.kind == "point"
                values[field.name] = ZERO if is_point else self.body_names[bodies[field.slot]]
        examined = self.examined.chosen(values) if self.examined.variants else self.examined
        functions = tuple(
            [self.function_place.get(values[name], 0) for name in examined.layout.functions]
        )
        others = tuple([work.others[name] for name in examined.layout.others])
        return Instance(element.name, examined, bodies, functions, values, others)

    # ---------------------------------------------------------------- fields, by kind

    def _body(self, field: _Field, value: Any, work: _Work) -> None:
        work.values[field.name] = value
        if value is None:
            return
        body = body_of(self.report, self.geometry.bodies, (*work.key, field.name), value)
        self._tell(field.name, field.slot, body, work)

    def _point(self, field: _Field, value: Any, work: _Work) -> None:
        if value is None:
            work.values[field.name] = None
            return
        found = self.geometry.points.get(value) if type(value) is str else None
        if found is None:
            found = point_of(self.report, self.geometry, (*work.key, field.name), value)
        self._located(field, found, work)

    def _vector(self, field: _Field, value: Any, work: _Work) -> None:
        if value is None:
            work.values[field.name] = None
            return
        key = (*work.key, field.name)
        found = vector_of(self.report, self.geometry, key, value, unit=field.spec.unit_length)
        self._located(field, found, work)

    def _located(
        self, field: _Field, found: tuple[int, tuple[float, ...]] | None, work: _Work
    ) -> None:
        if found is None:
            work.good = False
            return
        work.values[field.name] = found[1]
        if field.spec.ground and found[0] > 0:
            what = f"is on {self.body_names[found[0]]}; it is to be a vector of ground"
            self._refuse(work, (*work.key, field.name), self._given(work, field.name), what)
        elif field.slot < 0 and field.spec.kind == "vector" and not field.spec.ground:
            work.others[field.name] = found[0]
        self._tell(field.name, field.slot, found[0], work)

    def _vector2(self, field: _Field, value: Any, work: _Work) -> None:
        """A vector between two points, by its name or by the two points."""
        given = [end for end in self.ends if end in work.element.fields]
        key = (*work.key, field.name)
        ends = None
        if value is not _ABSENT and given:
            what = f"give {field.name} or P_i and P_j, not both"
            self.report.add(key, value, what)
        elif value is not _ABSENT or not self.ends:
            ends = self._declared(field, value, key)
        elif given:
            fields = work.element.fields
            ends = two_ends(
                self.report, self.geometry, work.key, fields.get("P_i"), fields.get("P_j")
            )
        else:
            what = f"is required, by name or by its ends P_i and P_j{_of(field)}"
            self.report.add(key, MISSING, what)
        if ends is None:
            work.good = False
            return
        for end, located in zip(ENDS, ends, strict=True):
            work.values[end] = located[1]
            letter = end[-1]
            if letter in self.slots:
                told_by = end if given else field.name
                self._tell(told_by, self.slots.index(letter), located[0], work)

    def _declared(self, field: _Field, value: Any, key: Key) -> Any:
        declared = self.geometry.vectors2
        if isinstance(value, str) and value in declared:
            return declared[value]
        words, near, remedy = missing_words(
            self.report, "vector between two points", value, declared
        )
        if isinstance(value, str) and value in self.geometry.vectors:
            remedy = f"{value} is a vector of one body; {field.name} is one of [vectors2]"
        self.report.add(key, value, words, near, remedy)
        return None

    def _function(self, field: _Field, value: Any, work: _Work) -> None:
        self._name_of(field, value, work, self.function_place, "function")

    def _joint(self, field: _Field, value: Any, work: _Work) -> None:
        self._name_of(field, value, work, self.report.scene.joints, "joint")

    def _name_of(
        self, field: _Field, value: Any, work: _Work, declared: dict[str, Any], what: str
    ) -> None:
        work.values[field.name] = value
        if value is None or (isinstance(value, str) and value in declared):
            return
        words = missing_words(self.report, what, value, declared)
        self.report.add((*work.key, field.name), value, *words)
        work.good = False

    def _value(self, field: _Field, value: Any, work: _Work) -> None:
        """A number, a list of numbers, a matrix or a word."""
        spec = field.spec
        if value is None and spec.default is None:
            work.values[field.name] = None
            return
        found: Any = value
        if spec.kind == "number":
            found = bounded(
                number_of(value),
                positive=spec.positive,
                minimum=spec.minimum,
                maximum=spec.maximum,
                whole=spec.whole,
            )
        elif spec.kind == "vec3":
            found = numbers_of(value, 3)
        elif spec.kind == "matrix":
            found = matrix_of(value)
        elif spec.kind == "table":
            found = list_of(value)
        elif spec.kind == "choice":
            found = word_of(value, spec.choices, spec.aliases)
        if isinstance(found, Fault):
            self.report.add((*work.key, field.name), value, found.what, found.nearest, found.remedy)
            work.good = False
        elif odd := oddity(spec, found):
            self.report.note(f"{dotted((*work.key, field.name))} = {shown(value)} {odd}")
        work.values[field.name] = found

    # ---------------------------------------------------------------- bodies of slots

    def _tell(self, name: str, slot: int, body: int, work: _Work) -> None:
        """A field says which body its slot is; all fields of a slot must agree."""
        if body == BAD:
            work.good = False
        elif slot >= 0:
            if work.bodies[slot] == _UNKNOWN:
                work.bodies[slot], work.told_by[slot] = body, name
            elif work.bodies[slot] != body:
                self._report_conflict(name, slot, body, work)

    def _check_slots(self, work: _Work) -> None:
        bodies = work.bodies
        if not bodies:
            return
        if _UNKNOWN not in bodies:
            self._check_others(work)
        if bodies[0] > 0 and bodies[-1] >= 0 and len(set(bodies)) == len(bodies) < 3:
            return  # what nearly all elements are
        if work.good and _UNKNOWN in bodies:
            letter = self.slots[bodies.index(_UNKNOWN)]
            fields = [f.name for f in self.fields if slot_of(f.name) == letter]
            what = f"which body is {letter}? Give {' or '.join(fields)}"
            self._refuse(work, work.key, MISSING, what)
        if bodies[0] == 0:
            self._report_ground(work)
        for n, body in enumerate(bodies):
            first = bodies.index(body)
            if body >= 0 and first < n:
                one, other = self.slots[first], self.slots[n]
                what = f"body {one} and body {other} are both {self.body_names[body]}"
                remedy = "an element acts between different bodies"
                field = work.told_by[n]
                self._refuse(work, (*work.key, field), self._given(work, field), what, remedy)

    def _check_others(self, work: _Work) -> None:
        """Vectors of no slot stand on one of the element's bodies."""
        for name, body in work.others.items():
            if body != BAD and body not in work.bodies:
                names = " or ".join(self.body_names[b] for b in work.bodies)
                what = f"is on {self.body_names[body]}; it is to be a vector of {names}"
                self._refuse(work, (*work.key, name), self._given(work, name), what)

    def _report_ground(self, work: _Work) -> None:
        name = work.told_by[0]
        key, value = (*work.key, name), self._given(work, name)
        if len(self.slots) > 1:
            what = "body i is ground; if one of the bodies is ground it is body j"
            self._refuse(work, key, value, what, "exchange the two bodies (all of _i and _j)")
        else:
            self._refuse(
                work, key, value, "the only body of this element is ground, which is fixed"
            )

    def _report_conflict(self, name: str, slot: int, body: int, work: _Work) -> None:
        letter, first = self.slots[slot], work.told_by[slot]
        here, there = self.body_names[body], self.body_names[work.bodies[slot]]
        what = f"{name} is on {here}, but {first} on {there}: all of _{letter} is on one body"
        remedy = ""
        if first not in work.element.fields and first not in self.ends:
            what = f"{name} is on {here}, but {first}, which is not given, is {there}"
            remedy = f'write {first} = "{here}", or take {name} on {there}'
        self._refuse(work, (*work.key, name), self._given(work, name), what, remedy)

    def _given(self, work: _Work, name: str) -> Any:
        return work.element.fields.get(name, MISSING)

    def _refuse(self, work: _Work, key: Key, value: Any, what: str, remedy: str = "") -> None:
        self.report.add(key, value, what, "", remedy)
        work.good = False

    def _report_unknown(self, work: _Work) -> None:
        for name, value in work.element.fields.items():
            if name not in self.known:
                near = nearest(name, self.known)
                self.report.add((*work.key, name), value, unknown_key(tuple(self.known)), near)
        work.good = False

    def _report_missing(self, field: _Field, work: _Work) -> None:
        self._refuse(work, (*work.key, field.name), MISSING, f"is required{_of(field)}")


def _of(field: _Field) -> str:
    """What a field is, in words, for a message about a key that is missing."""
    what = {"vec3": "3 numbers", "matrix": "3x3 numbers", "choice": "a word", "table": "numbers"}
    words = what.get(field.spec.kind, f"a {field.spec.kind}")
    return f" ({words}: {field.spec.doc})" if field.spec.doc else f" ({words})"


def read_elements(
    report: Collector, geometry: Geometry, table: str, types: dict[str, Examined]
) -> list[Instance]:
    """The elements of a table that are without mistakes, in file order.

    Args:
        report: takes mistakes and notes; its scene is read.
        geometry: where references lead.
        table: joints, forces or functions.
        types: the examined types that could be loaded, by keyword.
    """
    readers = {keyword: Reader(e, table, geometry, report) for keyword, e in types.items()}
    found = []
    for element in getattr(report.scene, table).values():
        reader = readers.get(element.type) if type(element.type) is str else None
        instance = reader.read(element) if reader is not None else None
        if instance is not None:
            found.append(instance)
    return found


def report_twins(report: Collector, table: str, instances: Iterable[Instance]) -> None:
    """Joints that are there twice are mistakes; forces twice, or other numbers, are notes."""
    seen: dict[Any, Instance] = {}
    for instance in instances:
        references = {
            n: v for n, v in instance.values.items() if not isinstance(v, (float, type(None)))
        }
        key = (id(instance.examined), instance.bodies, tuple(references.values()))
        twin = seen.setdefault(key, instance)
        if twin is instance:
            continue
        same = twin.values == instance.values
        if table == "joints" and same:
            what = f"is the same as {twin.name}: same type, same bodies, points and vectors"
            report.add((table, instance.name), MISSING, what, "", "take one of the two out")
        elif table == "joints" or same:
            words = "is the same as" if same else "differs only in its numbers from"
            report.note(f"{table}.{instance.name} {words} {table}.{twin.name}")
