"""Parameters of a scene by their dotted names: ``bodies.crank.mass``, ``points.A.sPp.x``.

A name is resolved part by part, so that it takes no longer in a large scene.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.suggestions import nearest, some
from dap3d_core.scene import Instance, Mistake, Scene, SceneError, Simulation, ValidatedScene
from dap3d_core.scene.coerce import canonical
from dap3d_core.scene.tables import LIMITS, NAMED, Element
from dap3d_core.settings import SETTINGS
from dap3d_core.study.design import FORMS, design_of

AXES = ("x", "y", "z")
EULER_PARAMETERS = ("e0", "e1", "e2", "e3")
#: Tables with parameters; shapes are only drawn, a vector2 has points alone.
TABLES = (
    *(table for table in NAMED if table not in ("shapes", "vectors2")),
    "parameters",
    "simulation",
)
#: Those of them without parts that have names.
FLAT = ("parameters", "simulation")
#: Kinds of fields that are numeric also where the scene leaves them to their type.
NUMERIC = ("number", "numbers", "vec3", "matrix", "square")
#: Defaults of a body (scene/validate/bodies.py).
BODY_DEFAULTS: dict[str, Any] = {"mass": 1.0, "Jp": (1.0, 1.0, 1.0)}
#: Units of fields that do not belong to a type.
UNITS = {"mass": "kg", "Jp": "kg m^2", "r": "m", "r_0": "m", "r_dot": "m/s", "w": "rad/s",
         "sPp": "m", "t_end": "s", "dt": "s", "step": "s", "Omega": "rad/s"}  # fmt: skip
FORM = "names are TABLE.NAME.FIELD, such as bodies.crank.mass, simulation.FIELD, parameters.NAME"


@attrs.frozen
class SceneParameter:
    """One number of a scene.

    Attributes:
        name: dotted, as the user gives it.
        path: table, owner and field; ``simulation`` and ``parameters`` have no owner.
        index: of the number in the field's value, from 0; empty for a scalar field.
        value: in the scene; None where the scene leaves it to the type.
        unit: SI, "1" for a number without dimension.
        whole: True if it must be an integer.
        default: value of the whole field where the scene does not give it.
    """

    name: str
    path: tuple[str, ...]
    index: tuple[int, ...]
    value: float | None
    unit: str = "1"
    whole: bool = False
    default: Any = attrs.field(default=None, repr=False)

    @property
    def table(self) -> str:
        """The table of the scene: bodies, points, forces, simulation, ..."""
        return self.path[0]

    @property
    def entries(self) -> frozenset[tuple[Any, ...]]:
        """Path and index of its entries: an off-diagonal one of an inertia matrix has two."""
        mirrored = self.index[::-1] if self.path[-1] == "Jp" else self.index
        return frozenset({(self.path, self.index), (self.path, mirrored)})

    def assign(self, scene: Scene, value: float) -> None:
        """Change the value in a scene; an inertia matrix stays symmetric."""
        holder = _holder(scene, self.path)
        field = self.path[-1]
        is_element = isinstance(holder, Element)
        changed: Any = value
        if self.index:
            given = holder.fields.get(field) if is_element else getattr(holder, field)
            changed = self.default if given is None else given
            for _, index in self.entries:
                changed = _replaced(changed, index, value)
        if is_element:
            holder.fields[field] = changed
        elif isinstance(holder, dict):
            holder[field] = changed
        else:
            setattr(holder, field, changed)


def with_values(
    scene: Scene, parameters: Sequence[SceneParameter], values: Sequence[float]
) -> Scene:
    """A copy of a scene with other values of parameters, which are not checked."""
    changed = scene.copy()
    for parameter, value in zip(parameters, values, strict=True):
        parameter.assign(changed, float(value))
    return changed


def parameters_named(
    checked: ValidatedScene, names: Sequence[str], key: str = "vary"
) -> tuple[SceneParameter, ...]:
    """Parameters of a scene by name.

    Args:
        checked: the scene.
        names: ``TABLE.NAME.FIELD``, ``simulation.FIELD``, ``parameters.NAME``; a component follows
            after a further dot: x, y, z, for Euler parameters e0 to e3, or its index, from 1.
        key: the argument that names them, for the mistakes.

    Raises:
        SceneError: unknown names, with the nearest; a parameter that is named twice.
    """
    parameters: list[SceneParameter] = []
    mistakes: list[Mistake] = []
    for name in names:
        parameter = _resolve(checked, name)
        if isinstance(parameter, Mistake):
            mistakes.append(parameter)
            continue
        same = next((other for other in parameters if other.entries & parameter.entries), None)
        if same is not None:
            alias = "" if same.name == name else f"this is {same.name} under another name; "
            mistakes.append(Mistake("vary", name, f"{alias}a number is varied only once"))
        parameters.append(parameter)
    if mistakes:
        raise SceneError([attrs.evolve(mistake, key=key) for mistake in mistakes])
    return tuple(parameters)


def all_parameters(checked: ValidatedScene) -> Iterator[SceneParameter]:
    """Every parameter of a scene, those that it leaves to its types as well."""
    for table in TABLES:
        for owner in ("",) if table in FLAT else getattr(checked.scene, table):
            for field in _fields(checked, (table, owner) if owner else (table,)):
                yield from field.parameters()


def names_under(checked: ValidatedScene, begin: str = "") -> list[str]:
    """Names that extend a beginning by one part; those that are no parameter end in a dot."""
    *head, _ = begin.split(".")
    table = head[0] if head else ""
    owners = getattr(checked.scene, table) if table in TABLES and table not in FLAT else ()
    depth = 1 if table in FLAT else 2
    if not head:
        names = [f"{t}." for t in TABLES if t == "simulation" or getattr(checked.scene, t)]
    elif len(head) == 1 and owners:
        names = [f"{table}.{owner}." for owner in owners]
    elif table not in TABLES or (depth == 2 and (len(head) < 2 or head[1] not in owners)):
        return []
    else:
        fields = list(_fields(checked, tuple(head[:depth])))
        field_of = {p.name: field.name for field in fields for p in field.parameters()}
        if len(head) == depth:
            names = [f.name if f.name in field_of else f"{f.name}." for f in fields]
        else:
            names = [name for name, field in field_of.items() if name != field]
    return [name for name in names if name.startswith(begin)]


@attrs.frozen
class _Field:
    """A numeric field: its path, and its value (None: left to the type)."""

    path: tuple[str, ...]
    value: Any
    unit: str
    whole: bool = False
    is_given: bool = True

    @property
    def name(self) -> str:
        return ".".join(self.path)

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the components: x, y, z; none where it has none."""
        value = self.value
        if type(value) is not tuple or any(type(part) is tuple for part in value):
            return ()
        if len(value) == 3:
            return AXES
        return EULER_PARAMETERS if self.path[-1] in ("p", "p_0") and len(value) == 4 else ()

    def parameter(self, name: str, index: tuple[int, ...] = ()) -> SceneParameter | None:
        """The parameter at an index; None where there is none."""
        value = self.value
        for k in index:
            if type(value) is not tuple or not 0 <= k < len(value):
                return None
            value = value[k]
        if value is not None and type(value) not in (int, float):
            return None
        default = None if self.is_given else self.value
        number = None if value is None else float(value)
        return SceneParameter(name, self.path, index, number, self.unit, self.whole, default)

    def parameters(self, index: tuple[int, ...] = ()) -> Iterator[SceneParameter]:
        """All parameters of the field, named by letters where it has some."""
        value = self.value
        for k in index:
            value = value[k]
        if type(value) is tuple:
            for k in range(len(value)):
                yield from self.parameters((*index, k))
            return
        letters = self.letters
        parts = [letters[index[0]]] if letters and index else [str(k + 1) for k in index]
        parameter = self.parameter(".".join((self.name, *parts)), index)
        if parameter is not None:
            yield parameter

    def index(self, parts: Sequence[str]) -> tuple[int, ...]:
        """Index of a component from 0, by letter or by numbers from 1; -1 for an invalid one."""
        letters = self.letters
        if len(parts) == 1 and parts[0] in letters:
            return (letters.index(parts[0]),)
        digits = [p if p.isascii() and p.isdigit() and len(p) < 10 else "0" for p in parts]
        return tuple(int(p) - 1 for p in digits)


def _resolve(checked: ValidatedScene, name: Any) -> SceneParameter | Mistake:
    """The parameter of a name, or what is wrong with the name."""
    if not isinstance(name, str):
        return Mistake("vary", name, "the name of a number is text such as 'bodies.crank.mass'")
    table, *rest = canonical(name).split(".")
    if table not in TABLES:
        return _no_table(checked, name, table, rest)
    path: tuple[str, ...] = (table,)
    if table not in FLAT:
        owners = getattr(checked.scene, table)
        if not rest:
            return Mistake("vary", name, f"this is a table; {FORM}")
        if rest[0] not in owners:
            return _unknown(name, path, rest, owners, f"there is no {rest[0]!r} in {table}")
        path = (table, rest.pop(0))
    fields = {field.path[-1]: field for field in _fields(checked, path)}
    if not rest:
        listed = some([f.name for f in fields.values()])
        return Mistake("vary", name, f"this is no single number; it has {listed}")
    if rest[0] not in fields:
        what = f"{'.'.join(path)} has no number {rest[0]!r}"
        return _unknown(name, path, rest, fields, what)
    field = fields[rest.pop(0)]
    parameter = field.parameter(name, field.index(rest)) if all(rest) else None
    if parameter is not None:
        return parameter
    parts = [p.name for p in field.parameters()]
    if not rest:
        return Mistake("vary", name, f"this is no single number; it has {some(parts)}")
    what = f"{field.name} has no number {'.'.join(rest)!r}; it has {some(parts)}"
    if parts == [field.name]:
        what = f"{field.name} is a number; it has no parts"
    return Mistake("vary", name, what, nearest(name, parts))


def _fields(checked: ValidatedScene, path: tuple[str, ...]) -> Iterator[_Field]:
    """The numeric fields of an owner, or of the settings."""
    table = path[0]
    holder = _holder(checked.scene, (*path, ""))
    if isinstance(holder, Element):
        instances: list[Instance] = getattr(checked, table)
        if table == "forces":  # those that are rigid, or stick, are contacts
            instances = [*instances, *checked.contacts]
        # of a contact of several points, NAME#1 and so on, the first
        instance = next(one for one in instances if one.name.partition("#")[0] == path[1])
        type_: Any = instance.type_info.type
        own = instance
        if getattr(type_, "load", ()):  # friction of a joint: what its force gives
            own = attrs.evolve(own, type_info=checked.registry.get("force", holder.type))
        yield from _element_fields(holder, path, own)
        for name in LIMITS if table == "joints" and type_.limit else ():
            unit = "1" if name == "e" else "rad" if type_.coordinate == "angle" else "m"
            if _is_numeric(value := holder.fields.get(name)):
                yield _Field((*path, name), value, unit)
        return
    if isinstance(holder, dict):
        for name, value in holder.items():
            yield _Field((*path, name), value, "SI")
        return
    for name in attrs.fields_dict(type(holder)):
        value = getattr(holder, name)
        is_given = value is not None
        if not is_given and table == "bodies":
            value = BODY_DEFAULTS.get(name)
        is_open = value is None and table == "simulation" and SETTINGS[name].default is None
        if _is_numeric(value) or is_open:
            yield _Field((*path, name), value, UNITS.get(name, "1"), is_given=is_given)


def _element_fields(
    element: Element, path: tuple[str, ...], instance: Instance
) -> Iterator[_Field]:
    for name, spec in specs_of(instance.type_info.type).items():
        value = element.fields.get(name)
        is_given = value is not None
        if not is_given and spec.kind in NUMERIC and spec.given:
            value = instance.values.get(name)
        is_open = value is None and spec.kind == "number" and spec.given
        if _is_numeric(value) or is_open:
            yield _Field((*path, name), value, spec.unit or "1", spec.whole, is_given)


def _is_numeric(value: Any) -> bool:
    """True for a number, or a list that begins with numbers."""
    while type(value) is tuple and value:
        value = value[0]
    return type(value) in (int, float)


def _holder(scene: Scene, path: tuple[str, ...]) -> Any:
    """The object of a scene that has the field at the end of a path."""
    holder = getattr(scene, path[0])
    return holder if path[0] in FLAT else holder[path[1]]


def _replaced(value: Any, index: tuple[int, ...], number: float) -> Any:
    """A nested tuple with another number at an index."""
    k, *rest = index
    part = _replaced(value[k], tuple(rest), number) if rest else number
    return (*value[:k], part, *value[k + 1 :])


def _no_table(checked: ValidatedScene, name: str, table: str, rest: list[str]) -> Mistake:
    """The mistake of a name without a table, with the name that was probably meant."""
    homes = [t for t in TABLES if t not in FLAT and table in getattr(checked.scene, t)]
    near = ""
    if homes:
        near = f"{homes[0]}.{name}"
        near += ".value" if homes[0] == "inputs" and not rest else ""
    elif name in checked.scene.parameters:
        near = f"parameters.{name}"
    elif not rest and table in attrs.fields_dict(Simulation):
        near = f"simulation.{name}"
    elif similar := nearest(table, TABLES):
        near = ".".join((similar, *rest))
    if near and isinstance(_resolve(checked, near), Mistake):
        near = ""
    what = "the scene has no number of this name"
    return Mistake("vary", name, what, near, "" if near else FORM)


def _unknown(
    name: str, path: tuple[str, ...], rest: list[str], known: Collection[str], what: str
) -> Mistake:
    """The mistake of an unknown part of a name, with the nearest known one."""
    near = nearest(rest[0], known)
    if near:
        return Mistake("vary", name, what, ".".join((*path, near, *rest[1:])))
    return Mistake("vary", name, f"{what}; it has {some(list(known)) if known else 'nothing'}")


def read_values(own: ValidatedScene, name: str, values: Any) -> tuple[SceneParameter, Floats]:
    """The parameter of a scene of this name and its values (n,), in the order given.

    Raises:
        SceneError: an unknown parameter, with the nearest; invalid values. The keys are
            ``parameter`` and ``values``.
    """
    if isinstance(values, str) and "~" in values:
        raise SceneError([Mistake("values", values, f"values are {FORMS}")])
    mistakes: list[Mistake] = []
    try:
        [parameter] = parameters_named(own, [name], "parameter")
    except SceneError as error:
        mistakes += error.mistakes
    try:
        numbers = design_of({name: values}, None, "lhs", 0).varied[0].values
    except SceneError as error:  # samples have no order to follow
        mistakes += [attrs.evolve(m, key="values", remedy=m.remedy.partition(", or sample")[0])
                     for m in error.mistakes]  # fmt: skip
    if mistakes or numbers is None:
        raise SceneError(mistakes)
    if parameter.whole and np.any(numbers != np.round(numbers)):
        what = f"{name} is a whole number; list whole values"
        raise SceneError([Mistake("values", values, what)])
    return parameter, numbers
