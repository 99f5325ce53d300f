"""Numbers of a scene by their dotted names: ``bodies.crank.mass``, ``points.A.sPp.x``."""

from collections.abc import Iterator, Sequence
from typing import Any

import attrs

from dap3d_core.interface.fields import specs_of
from dap3d_core.registry.spelling import nearest
from dap3d_core.scene import MISSING, Checked, Mistake, Scene, SceneError
from dap3d_core.scene.description import NAMED, Element

AXES = ("x", "y", "z")
PARAMETERS = ("e0", "e1", "e2", "e3")
#: Vectors of a body that stand in no file where they are zero, and how many components they have.
USUAL = {"r": 3, "r_dot": 3, "w": 3, "p": 4, "Jp": 3}


@attrs.frozen
class Number:
    """One number of a scene.

    Attributes:
        name: dotted, as the user gives it.
        path: table, owner and field; ``simulation`` has no owner.
        places: where in the field's value, from 0; empty for a single number.
        value: what stands there now; None where the scene leaves it to the type.
    """

    name: str
    path: tuple[str, ...]
    places: tuple[int, ...]
    value: float | None

    @property
    def table(self) -> str:
        """The table of the scene: bodies, points, forces, simulation, ..."""
        return self.path[0]

    def put(self, scene: Scene, value: float) -> None:
        """Give the number another value, in a scene that is changed."""
        holder = _holder(scene, self.path)
        field = self.path[-1]
        whole = value if not self.places else _replaced(_get(holder, field), self.places, value)
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
    known = {number.name: number for number in all_numbers(checked)}
    mistakes = []
    for k, name in enumerate(names):
        if not isinstance(name, str) or name not in known:
            mistakes.append(_unknown(checked, known, name))
        elif name in names[:k]:
            mistakes.append(Mistake("vary", name, "a number is varied only once"))
    if mistakes:
        raise SceneError(mistakes)
    found = tuple(known[name] for name in names)
    for k, number in enumerate(found):
        same = [n for n in found[:k] if n.path == number.path and n.places == number.places]
        if same:
            what = f"this is {same[0].name} under another name; a number is varied only once"
            mistakes.append(Mistake("vary", number.name, what))
    if mistakes:
        raise SceneError(mistakes)
    return found


def all_numbers(checked: Checked) -> Iterator[Number]:
    """Every number of a scene that can be varied, those that it leaves to its types as well."""
    scene = checked.scene
    instances = {
        "joints": {i.name: i for i in checked.joints},
        "forces": {i.name: i for i in checked.forces},
        "functions": {i.name: i for i in checked.functions},
    }
    for table in NAMED:
        for owner, holder in getattr(scene, table).items():
            values = _values(holder)
            if table in instances:
                kinds = specs_of(instances[table][owner].examined.type)
                for field, spec in kinds.items():
                    if spec.kind == "number" and values.get(field) is None:
                        values[field] = instances[table][owner].values.get(field)
                        values[field] = values[field] if values[field] is not None else 0.0
            for field, value in values.items():
                yield from _numbers_in(f"{table}.{owner}.{field}", (table, owner, field), value)
    for field, value in attrs.asdict(scene.simulation).items():
        yield from _numbers_in(f"simulation.{field}", ("simulation", field), value)


def _values(holder: Any) -> dict[str, Any]:
    """The fields of a part of a scene; of a body also those that it leaves open."""
    if isinstance(holder, Element):
        return dict(holder.fields)
    values = {a.name: getattr(holder, a.name) for a in attrs.fields(type(holder))}
    if "mass" in values:
        values["mass"] = 1.0 if values["mass"] is None else values["mass"]
        values["Jp"] = (1.0, 1.0, 1.0) if values["Jp"] is None else values["Jp"]
    return values


def _numbers_in(
    name: str, path: tuple[str, ...], value: Any, places: tuple[int, ...] = ()
) -> Iterator[Number]:
    if type(value) in (int, float):
        yield Number(name, path, places, float(value))
    elif type(value) is tuple:
        for k, part in enumerate(value):
            yield from _numbers_in(f"{name}.{k + 1}", path, part, (*places, k))
            letter = _letter(path[-1], len(value), k)
            if not places and letter and type(part) in (int, float):
                yield Number(f"{name}.{letter}", path, (k,), float(part))


def _letter(field: str, length: int, k: int) -> str:
    if length == 3:
        return AXES[k]
    return PARAMETERS[k] if field == "p" and length == 4 else ""


def _holder(scene: Scene, path: tuple[str, ...]) -> Any:
    if path[0] == "simulation":
        return scene.simulation
    return getattr(scene, path[0])[path[1]]


def _get(holder: Any, field: str) -> Any:
    value = _values(holder).get(field)
    return value


def _replaced(value: Any, places: tuple[int, ...], number: float) -> Any:
    """A nested tuple with another number at one place."""
    k, *rest = places
    part = _replaced(value[k], tuple(rest), number) if rest else number
    return (*value[:k], part, *value[k + 1 :])


def _unknown(checked: Checked, known: dict[str, Number], name: Any) -> Mistake:
    if not isinstance(name, str):
        return Mistake("vary", name, "the name of a number is text such as 'bodies.crank.mass'")
    begin = f"{name}."
    parts = [n for n in known if n.startswith(begin)]
    if parts:
        shown = ", ".join(parts[:6]) + (", ..." if len(parts) > 6 else "")
        return Mistake("vary", name, f"this is no single number; it has {shown}")
    near = nearest(name, known)
    what = "the scene has no number of this name"
    remedy = "" if near else "names are TABLE.NAME.FIELD, such as bodies.crank.mass"
    return Mistake("vary", name, what, nearest=near, remedy=remedy)


__all__ = ["MISSING", "Number", "all_numbers", "numbers_named", "with_values"]
