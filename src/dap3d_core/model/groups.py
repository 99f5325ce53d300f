"""Instances of one type, side by side: what one group loop runs over."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import attrs
import numpy as np

from dap3d_core.interface.codegen.instance_layout import shape_of, size
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.specialise import (
    bind_friction,
    bind_functions,
    names_behind,
    uncalled,
)
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.examine.constants import prepared
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import (
    BodyPose,
    TypeBase,
    acts_on_all,
    has_prepare,
    turns_of,
)
from dap3d_core.kernels.array_types import Floats as Floats
from dap3d_core.kernels.array_types import Integers as Integers
from dap3d_core.model.knots import knots_of
from dap3d_core.scene import Instance

Made = TypeVar("Made")


class PrepareError(ValueError):
    """A type's ``prepare`` refuses instances: (index of one, the type's own words) of each."""

    def __init__(self, *faults: tuple[int, str]) -> None:
        super().__init__(*faults)
        self.faults = faults

    def __str__(self) -> str:
        return "; ".join(words for _, words in self.faults)


@attrs.frozen(eq=False)
class Group:
    """All instances of a type in a model.

    Attributes:
        type_info: the type, its layout and names.
        members: (m,) their places among the scene's elements of this kind.
        bodies: (m, slots) body indices, ground 0.
        functions: (m, functions) rows of F, 0 for an absent function; then the bodies of vectors
            of no slot.
        numbers: (m, par_width) their numbers, as the layout says.
        tables: (instance, offset in its numbers, rows) of each table; the offset takes its place.
        joints: (m,) of friction, the joints it acts in; None for all else.
        loaded: (m,) of friction that sticks, the joints whose load it has; None for all else.
        read: of forces that read reactions, the joint of each instance by field: groups of m.
    """

    type_info: TypeInfo
    members: Integers
    bodies: Integers
    functions: Integers
    numbers: Floats
    tables: tuple[tuple[int, int, Floats], ...] = ()
    joints: Integers | None = None
    read: tuple["Group", ...] = ()
    loaded: Integers | None = None

    def number(self, name: str) -> Floats:
        """(m,) a number of each, by the name of its field; zeros where the type has none."""
        place = self.type_info.layout.numbers.get(name)
        return np.zeros(len(self.members)) if place is None else self.numbers[:, place[0]]

    def of_instance(self, k: int) -> dict[str, Floats]:
        """The numbers of an instance, by the names of their fields and in their shapes."""
        row, places = self.numbers[k], self.type_info.layout.numbers.items()
        return {n: row[at : at + size(shape)].reshape(shape) for n, (at, shape) in places}

    @property
    def keyword(self) -> str:
        """The type's word in a scene."""
        return self.type_info.type.keyword

    @property
    def count(self) -> int:
        """Number of instances."""
        return len(self.members)

    def take(self, places: Integers) -> "Group":
        """Some of the instances, by their places here."""
        tables = [(place, offset, rows) for place, k in enumerate(places.tolist())
                  for member, offset, rows in self.tables if member == k]  # fmt: skip
        return attrs.evolve(
            self,
            members=self.members[places],
            bodies=self.bodies[places],
            functions=self.functions[places],
            numbers=self.numbers[places],
            tables=tuple(tables),
            joints=None if self.joints is None else self.joints[places],
            loaded=None if self.loaded is None else self.loaded[places],
            read=tuple(group.take(places) for group in self.read),
        )

    def packed_numbers(self, p0: int) -> Floats:
        """The numbers as ``par`` holds them from p0 on, tables behind them, their places put in."""
        return _packed(self.numbers, self.tables, p0)


class Grouping:
    """Makes groups of a scene's elements.

    Args:
        kind: joint, force or function.
        poses: pose of each body index, ground included, as given.
        body_count: number of bodies without ground, for elements that act on each.
        functions: the scene's functions, for elements that take one of another argument than time.

    Attributes:
        notes: what the ``prepare`` of types warned about, with the element's name.
    """

    def __init__(
        self,
        kind: str,
        poses: Mapping[int, BodyPose],
        body_count: int,
        functions: Sequence[Instance] = (),
    ) -> None:
        self.kind, self.poses, self.body_count = kind, poses, body_count
        self.functions = {f.name: f for f in functions}
        self.notes: list[str] = []

    def groups(self, instances: Sequence[Instance], members: Sequence[int]) -> tuple[Group, ...]:
        """Sort instances by type, in the order in which types first appear.

        Each joint that may be released is in a group of its own.

        members: places of the instances among all elements of the kind.

        Raises:
            PrepareError: types refuse the values of instances: all of them.
        """
        by_type: dict[Any, list[int]] = {}
        for place, instance in enumerate(instances):
            given = tuple((n, f.structure) for n, f in self._given(instance).items())
            alone = None if instance.breaks_at is None else instance.name  # its loop may end
            by_type.setdefault((instance.structure, given, alone), []).append(place)
        return each(
            lambda places: self._group(
                [instances[k] for k in places], [members[k] for k in places]
            ),
            by_type.values(),
        )

    def loaded_groups(
        self, instances: Sequence[Instance], index: Mapping[str, int]
    ) -> tuple[Group, ...]:
        """``groups`` of all that has rows, in the order of ``index``: by name."""
        groups = self.groups(instances, range(len(instances)))
        return tuple(
            attrs.evolve(group, loaded=np.array([index[instances[k].values["joint"]]
                                                 for k in group.members.tolist()], dtype=np.int64))
            if getattr(group.type_info.type, "load", ()) else group
            for group in groups
        )  # fmt: skip

    def friction(
        self, forces: Sequence[tuple[int, Instance]], joints: Mapping[str, tuple[int, Instance]]
    ) -> tuple[Group, ...]:
        """Groups of the friction kernels of joints that forces switch on.

        Args:
            forces: (place among all forces, instance).
            joints: name -> (place among all joints, instance).

        Raises:
            PrepareError: joints have no friction, or numbers are missing.
        """
        by_type: dict[Any, list[tuple[int, Instance, int, Instance]]] = {}
        for place, force in forces:
            row, joint = joints[force.values[force.type_info.friction_joint]]
            by_type.setdefault(joint.type_info.type, []).append((place, force, row, joint))
        return each(self._friction, by_type.values())

    def _friction(self, pairs: list[tuple[int, Instance, int, Instance]]) -> Group:
        type_info = pairs[0][3].type_info
        if "friction" not in type_info.kernels:
            words = f"type {type_info.type.keyword} has no friction"
            raise PrepareError(*[(place, f"joint {j.name}: {words}") for place, _, _, j in pairs])
        bound = bind_friction(type_info)
        group = self._group([joint for *_, joint in pairs], [row for _, _, row, _ in pairs])
        wanted = [n for n in bound.layout.numbers if n not in type_info.layout.numbers]
        asked = {q for q in wanted if q in parameters(bound.kernels["friction"])}
        extra, faults = np.zeros((len(pairs), len(wanted))), []
        for k, (place, force, _, _) in enumerate(pairs):
            for c, name in enumerate(wanted):
                value = force.values.get(name)
                if value is None and name in asked:
                    words = f"{name} is missing, which friction in {type_info.type.keyword} needs"
                    faults.append((place, words))
                extra[k, c] = 0.0 if value is None else value
        if faults:
            raise PrepareError(*faults)
        members = np.array([place for place, *_ in pairs], dtype=np.int64)
        numbers = np.hstack([group.numbers, extra])
        return attrs.evolve(group, type_info=bound, numbers=numbers, joints=group.members,
                            members=members)  # fmt: skip

    def _given(self, instance: Instance) -> dict[str, Instance]:
        """The functions of an argument that an instance is given, by field."""
        names = {field: instance.values[field] for field in instance.type_info.argument_functions}
        return {field: self.functions[name] for field, name in names.items() if name is not None}

    def _group(self, instances: list[Instance], members: list[int]) -> Group:
        type_info = instances[0].type_info
        on_each = bool(acts_on_all(type_info.type))
        turns = turns_of(type_info.type, self.body_count) if on_each else []
        n = len(turns)
        if on_each and has_prepare(type_info.type):  # its constants may differ from body to body
            on_each = False
            members = [m for m in members for _ in range(n)]
            instances = [attrs.evolve(i, bodies=turn) for i in instances for turn in turns]
        count = len(instances)
        if instances[0].terms:
            type_info, numbers, tables = self._combined(instances, members)
        else:
            numbers, tables = self._numbers(type_info, instances, members)
        functions = [self._given(i) for i in instances]
        if type_info.type.prepare_functions is not TypeBase.prepare_functions:
            self._prepare_functions(instances, members, numbers)
        if functions[0]:
            type_info, numbers, more = self._with_functions(type_info, functions, numbers, members)
            tables += more
        if missing := uncalled(type_info):
            words = f"{missing} is missing, which this type calls"
            raise PrepareError(*[(member, words) for member in members])
        bodies = np.array([i.bodies for i in instances], dtype=np.int64).reshape(count, -1)
        others = [(*i.functions, *i.others) for i in instances]
        integers = np.array(others, dtype=np.int64).reshape(count, -1)
        places = np.array(members, dtype=np.int64)
        if on_each:
            bodies = np.tile(np.array(turns, dtype=np.int64), (count, 1))
            numbers = np.repeat(numbers, n, axis=0)
            integers = np.repeat(integers, n, axis=0)
            places = np.repeat(places, n)
        return Group(type_info, places, bodies, integers, numbers, tuple(tables))

    def _with_functions(
        self,
        type_info: TypeInfo,
        functions: list[dict[str, Instance]],
        numbers: Floats,
        members: Sequence[int],
    ) -> tuple[TypeInfo, Floats, list[tuple[int, int, Floats]]]:
        """The type with its functions known, their numbers behind its own, their tables."""
        types: dict[str, TypeInfo] = {}
        tables: list[tuple[int, int, Floats]] = []
        counts: dict[str, int] = {}
        for field in functions[0]:
            column = [of_instance[field] for of_instance in functions]
            types[field], more, found = self._behind(numbers, column, members)
            tables += found
            knots = knots_of(column)
            counts[field] = knots.shape[1]
            numbers = np.hstack([numbers, more, knots])
        return bind_functions(type_info, types, counts), numbers, tables

    def _behind(
        self, numbers: Floats, functions: Sequence[Instance], members: Sequence[int]
    ) -> tuple[TypeInfo, Floats, list[tuple[int, int, Floats]]]:
        """``_combined`` of functions of elements, with tables behind the numbers of these."""
        try:
            type_info, more, tables = self._combined(functions, range(len(functions)))
        except PrepareError as error:
            raise PrepareError(
                *[(members[k], f"function {functions[k].name}: {w}") for k, w in error.faults]
            ) from error
        return type_info, more, [(k, numbers.shape[1] + at, rows) for k, at, rows in tables]

    def _prepare_functions(
        self, instances: list[Instance], members: Sequence[int], numbers: Floats
    ) -> None:
        """Put in place the numbers that types find from functions of an argument."""

        def put(place: int) -> None:
            instance, row = instances[place], numbers[place]
            try:
                given = {n: self.callable_of(f) for n, f in self._given(instance).items()}
                constants = as_object(instance).prepare_functions(given)
            except ValueError as error:
                raise PrepareError((members[place], str(error))) from error
            for name, value in constants.items():
                offset, shape = instance.type_info.layout.numbers[name]
                row[offset : offset + size(shape)] = np.reshape(value, -1)

        each(put, range(len(instances)))

    def callable_of(self, function: Instance) -> Callable[[float], Any]:
        """A function of one argument in Python."""
        from dap3d_core.kernels.runtime import loop_support  # what loops call

        type_info, numbers, tables = self._combined([function], [0])
        places = {**vars(loop_support), "par": _packed(numbers, tables, 0).tolist(), "p1": 0}
        names, kernel = names_behind(type_info, type_info.layout), type_info.kernels["value"]
        given = {n: eval(names[n].code, places) for n in parameters(kernel) if n != "x"}
        return lambda x: kernel(**given, x=x)

    def _combined(
        self, functions: Sequence[Instance], members: Sequence[int]
    ) -> tuple[TypeInfo, Floats, list[tuple[int, int, Floats]]]:
        """The type of functions of one structure with their terms known, numbers and tables."""
        type_info = functions[0].type_info
        numbers, tables = self._numbers(type_info, functions, members)
        if not functions[0].terms:
            return type_info, numbers, tables
        from dap3d_core.interface.codegen.terms import bind_terms

        terms = []
        for column in zip(*(function.terms for function in functions), strict=True):
            term, more, found = self._behind(numbers, column, members)
            terms.append(term)
            tables += found
            numbers = np.hstack([numbers, more])
        return bind_terms(type_info, terms), numbers, tables

    def _numbers(
        self, type_info: TypeInfo, instances: Sequence[Instance], members: Sequence[int]
    ) -> tuple[Floats, list[tuple[int, int, Floats]]]:
        """(m, par_width) numbers of all instances, from their fields and ``prepare``; tables."""
        given, fields = [i.values for i in instances], specs_of(type_info.type)
        if has_prepare(type_info.type):

            def constants_of(place: int) -> dict[str, Any]:
                with warnings.catch_warnings(record=True) as record:
                    warnings.simplefilter("always")
                    try:
                        return _prepared(instances[place], members[place], self.poses)
                    finally:
                        self._note(record, instances[place])

            found = each(constants_of, range(len(instances)))
            given = [values | constants for values, constants in zip(given, found, strict=True)]
        numbers = np.zeros((len(instances), type_info.layout.par_width))
        for name, (offset, shape) in type_info.layout.numbers.items():
            column = [values.get(name) for values in given]
            if name in fields and fields[name].by_name:  # left out it is zero
                column = [value or 0.0 for value in column]
            if None in column:
                words = "is missing" if name in fields else "is not among what prepare returned"
                raise PrepareError((members[column.index(None)], f"{name} {words}"))
            values = np.asarray(column, dtype=float).reshape(len(instances), -1)
            numbers[:, offset : offset + size(shape)] = values
        tables = []
        for name, (offset, columns) in type_info.layout.tables.items():
            for k, of_instance in enumerate(given):
                rows = np.asarray(of_instance[name], dtype=float).reshape(-1, columns)
                numbers[k, offset + 1] = len(rows)
                tables.append((k, offset, rows))
        return numbers, tables

    def _note(self, record: list[warnings.WarningMessage], instance: Instance) -> None:
        """Turns the warnings of ``prepare`` into notes."""
        keyword = instance.type_info.type.keyword
        for warning in record:
            note = f"{self.kind} {instance.name} ({keyword}): {warning.message}"
            if note not in self.notes:
                self.notes.append(note)


def each(make: Callable[[Any], Made], parts: Iterable[Any]) -> tuple[Made, ...]:
    """What is made of each part; a PrepareError has the faults of all."""
    made: list[Made] = []
    faults: list[tuple[int, str]] = []
    for part in parts:
        try:
            made.append(make(part))
        except PrepareError as error:
            faults += error.faults
    if faults:
        raise PrepareError(*faults)
    return tuple(made)


def _packed(numbers: Floats, tables: Iterable[tuple[int, int, Floats]], p0: int) -> Floats:
    """Numbers with tables behind them, as ``par`` holds them from p0 on."""
    numbers = numbers.copy()
    end = p0 + numbers.size
    for k, offset, rows in tables:
        numbers[k, offset] = end
        end += rows.size
    return np.concatenate([numbers.ravel(), *(rows.ravel() for _, _, rows in tables)])


def as_object(instance: Instance, class_: Any = None) -> Any:
    """An instance as an object of its type, or of a class in its place: what ``prepare`` reads."""
    type_: Any = instance.type_info.type
    fields, values = specs_of(type_), instance.values
    found = (class_ or type_)(**{n: values[n] for n in fields if n in values})
    if any(spec.kind == "vector2" for spec in fields.values()):
        found.P_i, found.P_j = values["P_i"], values["P_j"]
    return found


def _prepared(instance: Instance, member: int, poses: Mapping[int, BodyPose]) -> dict[str, Any]:
    """Values that ``prepare`` returns for an instance, with the names and shapes examined."""
    type_info = instance.type_info
    bodies = {s: poses[b] for s, b in zip(type_info.layout.slots, instance.bodies, strict=True)}
    try:
        constants = prepared(as_object(instance), bodies)
    except ValueError as error:
        raise PrepareError((member, str(error))) from error
    for name, value in constants.items():
        if name in type_info.layout.tables:
            continue
        _, shape = type_info.layout.numbers.get(name, (0, None))
        if shape_of(value) != shape:
            usual = "none" if shape is None else shape
            words = (
                f"prepare returned {name} of shape {shape_of(value)}, and for random values of the "
                f"fields {usual}; names and shapes must stay the same"
            )
            raise PrepareError((member, words))
    return constants
