"""Other numbers for a force of a model that is made: what its rows would hold."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.model.groups import Floats, Group, Grouping, Integers
from dap3d_core.model.model import Model, ReferencePoses
from dap3d_core.registry.suggestions import did_you_mean
from dap3d_core.scene import ValidatedScene
from dap3d_core.scene.validate import coerce_values


class Change(NamedTuple):
    """Entries of a group's numbers: their values are to be ``new`` where ``where`` is true."""

    group: Group
    places: Integers
    where: Any
    new: Floats


def changed(checked: ValidatedScene, model: Model, place: int, fields: Mapping[str, Any]) -> Change:
    """Parameters of a force for changed fields.

    place: of the force among those of the scene; fields: field -> number, three numbers, matrix.

    Raises:
        ValueError: the force has no such field, or it cannot be changed, or not to this value.
    """
    force = checked.forces[place]
    specs = specs_of(force.type_info.type)
    values = {name: _value(force.name, specs, name, value) for name, value in fields.items()}
    for group in model.forces:
        places = np.flatnonzero(group.members == place)
        if len(places):
            return _of_force(checked, group, places, place, values)
    return _of_friction(model, force.name, place, values)


def _value(force: str, specs: Mapping[str, FieldSpec], name: str, value: Any) -> Any:
    """The value of a field, checked as in a scene."""
    kinds = ("number", "numbers", "vec3", "matrix", "square")
    numeric = [n for n, s in specs.items() if s.kind in kinds]
    if name not in numeric:
        hint = did_you_mean(name, numeric, otherwise=f"it has {', '.join(numeric) or 'none'}")
        raise ValueError(f"force {force} has no numbers under the name {name!r}; {hint}")
    spec = specs[name]
    found: Any
    if spec.kind == "number":
        limits = {n: getattr(spec, n) for n in ("positive", "minimum", "maximum", "whole")}
        found = coerce_values.bounded(coerce_values.number_of(value), **limits)
    elif spec.kind == "square":
        found = coerce_values.square_of(value, spec.columns)
    else:
        count = {"vec3": 3, "numbers": spec.columns}.get(spec.kind, 0)
        found = coerce_values.numbers_of(value, count) if count else coerce_values.matrix_of(value)
    if isinstance(found, coerce_values.Fault):
        raise ValueError(f"force {force}: {name} {found.what}, not {value!r}")
    return found


def _of_force(
    checked: ValidatedScene, group: Group, places: Integers, place: int, values: Mapping[str, Any]
) -> Change:
    force = checked.forces[place]
    n = len(checked.body_names)
    grouping = Grouping("force", ReferencePoses(checked), n, checked.functions)
    given = {**force.values, **values}
    try:
        (old,) = grouping.groups([force], [place])
        (new,) = grouping.groups([attrs.evolve(force, values=given)], [place])
    except ValueError as error:  # PrepareError: the type's own words
        raise ValueError(f"force {force.name}: {error}") from error
    pairs = zip(old.tables, new.tables, strict=True)
    if not all(np.array_equal(a, b) for (*_, a), (*_, b) in pairs):
        raise ValueError(f"force {force.name}: this would change a table, which cannot be done")
    # what is the same stays: turns that were counted, places of tables, numbers changed before,
    # those of joints that it reads, which stand behind its own
    behind = [(0, 0), (0, group.numbers.shape[1] - new.numbers.shape[1])]
    where = np.pad(old.numbers != new.numbers, behind)
    return Change(group, places, where, np.pad(new.numbers, behind))


def _of_friction(model: Model, name: str, place: int, values: Mapping[str, Any]) -> Change:
    """The numbers that a force brings into the friction of a joint."""
    for group in model.friction:
        places = np.flatnonzero(group.members == place)
        if not len(places):
            continue
        numbers = group.numbers[places].copy()
        where = np.zeros(numbers.shape, dtype=bool)
        own = specs_of(group.type_info.type)
        for field, value in values.items():
            if field in own or field not in group.type_info.layout.numbers:
                raise ValueError(f"force {name}: {field} is not used in this joint")
            at, _ = group.type_info.layout.numbers[field]
            numbers[:, at], where[:, at] = value, True
        return Change(group, places, where, numbers)
    raise ValueError(f"force {name} has no numbers")
