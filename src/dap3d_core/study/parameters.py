"""Numbers of a scene by their dotted names: ``bodies.crank.mass``, ``points.A.sPp.x``.

A name is followed part by part, so that a scene may have any number of others.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import attrs

from dap3d_core.interface.fields import specs_of
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import Checked, Instance, Mistake, Scene, SceneError, Simulation
from dap3d_core.scene.scene import NAMED, Element
from dap3d_core.scene.validate.settings import OPEN

AXES = ("x", "y", "z")
PARAMETERS = ("e0", "e1", "e2", "e3")
#: Tables whose parts have numbers; shapes are only drawn, a vector2 has points alone.
TABLES = (*(table for table in NAMED if table not in ("shapes", "vectors2")), "simulation")
#: Kinds of fields that are numbers also where the scene leaves them to their type.
NUMERIC = ("number", "vec3", "matrix")
#: What is used for a body that does not give it (scene/validate/bodies.py).
USUAL: dict[str, Any] = {"mass": 1.0, "Jp": (1.0, 1.0, 1.0)}
#: Units of what is no field of a type.
UNITS = {"mass": "kg", "Jp": "kg m^2", "r": "m", "r_dot": "m/s", "w": "rad/s", "sPp": "m",
         "t_end": "s", "dt": "s", "step": "s", "Omega": "rad/s"}  # fmt: skip
#: As many names are shown in a message.
SHOWN = 6
FORM = "names are TABLE.NAME.FIELD, such as bodies.crank.mass, or simulation.FIELD"


@attrs.frozen
class Number:
    """One number of a scene.

    Attributes:
        name: dotted, as the user gives it.
        path: table, owner and field; ``simulation`` has no owner.
        places: where in the field's value, from 0; empty for a single number.
        value: what stands there now; None where the scene leaves it to the type.
        unit: SI, "1" where it has none.
        whole: whether it must be a whole number.
        default: the whole field as it is used where the scene does not give it.
    """

    name: str
    path: tuple[str, ...]
    places: tuple[int, ...]
    value: float | None
    unit: str = "1"
    whole: bool = False
    default: Any = attrs.field(default=None, repr=False)

    @property
    def table(self) -> str:
        """The table of the scene: bodies, points, forces, simulation, ..."""
        return self.path[0]

    @property
    def twins(self) -> frozenset[tuple[Any, ...]]:
        """Where it stands: of an inertia matrix an entry beside the diagonal stands twice."""
        turned = self.places[::-1] if self.path[-1] == "Jp" else self.places
        return frozenset({(self.path, self.places), (self.path, turned)})

    def put(self, scene: Scene, value: float) -> None:
        """Give the number another value, in a scene that is changed.

        An inertia matrix stays symmetric: an entry beside its diagonal is changed with its twin.
        """
        holder = _holder(scene, self.path)
        field = self.path[-1]
        whole: Any = value
        if self.places:
            given = _given(holder, field)
            whole = self.default if given is None else given
            for _, places in self.twins:
                whole = _replaced(whole, places, value)
        if isinstance(holder, Element):
            holder.fields[field] = whole
        else:
            setattr(holder, field, whole)


def with_values(scene: Scene, numbers: Sequence[Number], values: Sequence[float]) -> Scene:
    """A copy of a scene in which numbers have other values; nothing is checked."""
    changed = scene.copy()
    for number, value in zip(numbers, values, strict=True):
        number.put(changed, float(value))
    return changed


def numbers_named(checked: Checked, names: Sequence[str]) -> tuple[Number, ...]:
    """Numbers of a scene by name.

    Args:
        checked: the scene.
        names: ``TABLE.NAME.FIELD`` or ``simulation.FIELD``; a component follows behind a further
            dot: x, y, z, for Euler parameters e0 to e3, or its place in the list, from 1.

    Raises:
        SceneError: a name is none of these, the nearest is shown; or it is given twice.
    """
    found: list[Number] = []
    mistakes: list[Mistake] = []
    for name in names:
        number = _followed(checked, name)
        if isinstance(number, Mistake):
            mistakes.append(number)
            continue
        same = next((other for other in found if other.twins & number.twins), None)
        if same is not None:
            alias = "" if same.name == name else f"this is {same.name} under another name; "
            mistakes.append(Mistake("vary", name, f"{alias}a number is varied only once"))
        found.append(number)
    if mistakes:
        raise SceneError(mistakes)
    return tuple(found)


def all_numbers(checked: Checked) -> Iterator[Number]:
    """Every number of a scene that can be varied, those that it leaves to its types as well."""
    for table in TABLES:
        for owner in _owners(checked.scene, table):
            path = (table, owner) if owner else (table,)
            for field in _fields(checked, path):
                yield from _numbers_in(field)


def names_under(checked: Checked, begin: str = "") -> list[str]:
    """The names that go on from a beginning by one part; those that are no number end in a dot."""
    *head, _ = begin.split(".")
    if not head:
        found = [f"{t}." for t in TABLES if t == "simulation" or getattr(checked.scene, t)]
    elif len(head) == 1 and head[0] in TABLES and head[0] != "simulation":
        found = [f"{head[0]}.{owner}." for owner in getattr(checked.scene, head[0])]
    else:
        of_table = 1 if head[0] == "simulation" else 2
        path = tuple(head[:of_table])
        if head[0] not in TABLES or (
            of_table == 2 and head[1] not in getattr(checked.scene, head[0])
        ):
            return []
        fields = list(_fields(checked, path))
        parts = {n.name: field.name for field in fields for n in _numbers_in(field)}
        if len(head) == of_table:
            single = [name for name, field in parts.items() if name == field]
            found = [f.name if f.name in single else f"{f.name}." for f in fields]
        else:
            found = [name for name, field in parts.items() if name != field]
    return [name for name in found if name.startswith(begin)]


@attrs.frozen
class _Field:
    """A field with numbers: its path, its value (None: left to the type), what it is."""

    path: tuple[str, ...]
    value: Any
    unit: str
    whole: bool = False
    is_given: bool = True

    @property
    def name(self) -> str:
        return ".".join(self.path)

    def number(self, name: str, places: tuple[int, ...] = ()) -> Number | None:
        """The number at a place; None where there is none."""
        value = self.value
        for k in places:
            if type(value) is not tuple or not 0 <= k < len(value):
                return None
            value = value[k]
        if value is not None and type(value) not in (int, float):
            return None
        default = None if self.is_given else self.value
        now = None if value is None else float(value)
        return Number(name, self.path, places, now, self.unit, self.whole, default)


def _followed(checked: Checked, name: Any) -> Number | Mistake:
    """The number of a name, found part by part, or what is wrong with it."""
    if not isinstance(name, str):
        return Mistake("vary", name, "the name of a number is text such as 'bodies.crank.mass'")
    table, *rest = name.split(".")
    if table not in TABLES:
        return _no_table(checked, name, table, rest)
    path: tuple[str, ...] = (table,)
    if table != "simulation":
        owners = getattr(checked.scene, table)
        if not rest:
            return Mistake("vary", name, f"this is a table; {FORM}")
        if rest[0] not in owners:
            return _unknown(name, path, rest, owners, f"there is no {rest[0]!r} in {table}")
        path = (table, rest.pop(0))
    fields = {field.path[-1]: field for field in _fields(checked, path)}
    if not rest:
        shown = _listed([f.name for f in fields.values()])
        return Mistake("vary", name, f"this is no single number; it has {shown}")
    if rest[0] not in fields:
        what = f"{'.'.join(path)} has no number {rest[0]!r}"
        return _unknown(name, path, rest, fields, what)
    field = fields[rest.pop(0)]
    number = field.number(name, _places(field, rest)) if all(rest) else None
    if number is not None:
        return number
    parts = [n.name for n in _numbers_in(field)]
    if not rest:
        return Mistake("vary", name, f"this is no single number; it has {_listed(parts)}")
    what = f"{field.name} has no number {'.'.join(rest)!r}; it has {_listed(parts)}"
    if parts == [field.name]:
        what = f"{field.name} is a number; it has no parts"
    return Mistake("vary", name, what, nearest(name, parts))


def _places(field: _Field, parts: Sequence[str]) -> tuple[int, ...]:
    """Where a component stands, from 0; -1 for what is none."""
    letters = _letters(field)
    if len(parts) == 1 and parts[0] in letters:
        return (letters.index(parts[0]),)
    digits = [p if p.isascii() and p.isdigit() and len(p) < 10 else "0" for p in parts]
    return tuple(int(p) - 1 for p in digits)


def _letters(field: _Field) -> tuple[str, ...]:
    """The letters of the components of a field: x, y, z; none where it has none."""
    value = field.value
    if type(value) is not tuple or any(type(part) is tuple for part in value):
        return ()
    if len(value) == 3:
        return AXES
    return PARAMETERS if field.path[-1] == "p" and len(value) == 4 else ()


def _numbers_in(field: _Field, places: tuple[int, ...] = ()) -> Iterator[Number]:
    """All numbers of a field, components by their letters where they have some."""
    value = field.value
    for k in places:
        value = value[k]
    if type(value) is tuple:
        for k in range(len(value)):
            yield from _numbers_in(field, (*places, k))
        return
    letters = _letters(field)
    parts = [letters[places[0]]] if letters and places else [str(k + 1) for k in places]
    number = field.number(".".join((field.name, *parts)), places)
    if number is not None:
        yield number


def _owners(scene: Scene, table: str) -> Collection[str]:
    return ("",) if table == "simulation" else getattr(scene, table)


def _fields(checked: Checked, path: tuple[str, ...]) -> Iterator[_Field]:
    """The fields with numbers of a part of a scene."""
    table = path[0]
    holder = _holder(checked.scene, (*path, ""))
    if isinstance(holder, Element):
        yield from _element_fields(holder, path, _instance(checked, *path))
        return
    for attribute in attrs.fields(type(holder)):
        name = attribute.name
        value = getattr(holder, name)
        given = value is not None
        if not given and table == "bodies":
            value = USUAL.get(name)
        is_open = table == "simulation" and name in OPEN
        if _is_numeric(value) or (value is None and is_open):
            yield _Field((*path, name), value, UNITS.get(name, "1"), is_given=given)


def _element_fields(
    element: Element, path: tuple[str, ...], instance: Instance
) -> Iterator[_Field]:
    for name, spec in specs_of(instance.examined.type).items():
        value = element.fields.get(name)
        given = value is not None
        if not given and spec.kind in NUMERIC and spec.given:
            value = instance.values.get(name)
        is_open = value is None and spec.kind == "number" and spec.given
        if _is_numeric(value) or is_open:
            yield _Field((*path, name), value, spec.unit or "1", spec.whole, given)


def _instance(checked: Checked, table: str, owner: str) -> Instance:
    instances: list[Instance] = getattr(checked, table)
    return next(instance for instance in instances if instance.name == owner)


def _is_numeric(value: Any) -> bool:
    """Whether a value is a number, or a list that begins with numbers."""
    while type(value) is tuple and value:
        value = value[0]
    return type(value) in (int, float)


def _holder(scene: Scene, path: tuple[str, ...]) -> Any:
    """The part of a scene that has the field at the end of a path."""
    if path[0] == "simulation":
        return scene.simulation
    return getattr(scene, path[0])[path[1]]


def _given(holder: Any, field: str) -> Any:
    """What a scene gives for a field, or None."""
    return holder.fields.get(field) if isinstance(holder, Element) else getattr(holder, field)


def _replaced(value: Any, places: tuple[int, ...], number: float) -> Any:
    """A nested tuple with another number at one place."""
    k, *rest = places
    part = _replaced(value[k], tuple(rest), number) if rest else number
    return (*value[:k], part, *value[k + 1 :])


def _no_table(checked: Checked, name: str, table: str, rest: list[str]) -> Mistake:
    """A name that begins with no table: a misspelt one, or that of a part of the scene."""
    homes = [t for t in TABLES if t != "simulation" and table in getattr(checked.scene, t)]
    near = ""
    if homes:
        near = f"{homes[0]}.{name}"
    elif not rest and table in attrs.fields_dict(Simulation):
        near = f"simulation.{name}"
    elif found := nearest(table, TABLES):
        near = ".".join((found, *rest))
    if near and isinstance(_followed(checked, near), Mistake):
        near = ""
    what = "the scene has no number of this name"
    return Mistake("vary", name, what, near, "" if near else FORM)


def _unknown(
    name: str, path: tuple[str, ...], rest: list[str], known: Collection[str], what: str
) -> Mistake:
    """A part of a name that is not there, with the nearest that is."""
    near = nearest(rest[0], known)
    if near:
        return Mistake("vary", name, what, ".".join((*path, near, *rest[1:])))
    shown = _listed(list(known)) if known else "nothing"
    return Mistake("vary", name, f"{what}; it has {shown}")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")


__all__ = ["Number", "all_numbers", "names_under", "numbers_named", "with_values"]
