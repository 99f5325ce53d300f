"""Instances of one type, side by side: what one group loop runs over."""

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.checks import BodyPose, Examined, prepared
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.namespace import shape_of, size
from dap3d_core.interface.types import TypeBase
from dap3d_core.scene import Instance

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]


class PrepareError(ValueError):
    """A type's ``prepare`` refuses an instance: (index of the instance, the type's own words)."""


@attrs.frozen(eq=False)
class Group:
    """All instances of a type in a model.

    Attributes:
        examined: the type, its layout and names.
        members: (m,) their places among the scene's elements of this kind.
        bodies: (m, slots) body indices, ground 0.
        functions: (m, functions) rows of F, 0 for an absent function.
        numbers: (m, par_width) their numbers, as the layout says.
    """

    examined: Examined
    members: Integers
    bodies: Integers
    functions: Integers
    numbers: Floats

    @property
    def keyword(self) -> str:
        """The type's word in a scene."""
        return self.examined.type.keyword

    @property
    def count(self) -> int:
        """How many instances."""
        return len(self.members)


def make_groups(
    instances: Sequence[Instance], poses: Mapping[int, BodyPose], body_count: int
) -> tuple[Group, ...]:
    """Sort instances by type, in the order in which types first appear.

    Args:
        instances: checked joints, forces or functions of a scene, in file order.
        poses: pose of each body index, ground included, as given.
        body_count: number of bodies without ground, for elements that act on each.

    Raises:
        PrepareError: a type refuses the values of an instance.
    """
    by_type: dict[type[TypeBase], list[int]] = {}
    for index, instance in enumerate(instances):
        by_type.setdefault(instance.examined.type, []).append(index)
    return tuple(
        _group([instances[m] for m in members], members, poses, body_count)
        for members in by_type.values()
    )


def _group(
    instances: list[Instance], members: list[int], poses: Mapping[int, BodyPose], body_count: int
) -> Group:
    examined = instances[0].examined
    on_each = bool(getattr(examined.type, "each_body", False))
    if on_each and _prepares(examined.type):  # its constants may differ from body to body
        on_each = False
        members = [m for m in members for _ in range(body_count)]
        instances = [
            attrs.evolve(i, bodies=(b,)) for i in instances for b in range(1, body_count + 1)
        ]
    count = len(instances)
    numbers = _numbers(examined, instances, members, poses)
    bodies = np.array([i.bodies for i in instances], dtype=np.int64).reshape(count, -1)
    functions = np.array([i.functions for i in instances], dtype=np.int64).reshape(count, -1)
    places = np.array(members, dtype=np.int64)
    if on_each:
        bodies = np.tile(np.arange(1, body_count + 1), count)[:, None]
        numbers = np.repeat(numbers, body_count, axis=0)
        functions = np.repeat(functions, body_count, axis=0)
        places = np.repeat(places, body_count)
    return Group(examined, places, bodies, functions, numbers)


def _numbers(
    examined: Examined, instances: list[Instance], members: list[int], poses: Mapping[int, BodyPose]
) -> Floats:
    """(m, par_width) numbers of all instances, from their fields and from ``prepare``."""
    given, fields = [instance.values for instance in instances], specs_of(examined.type)
    if _prepares(examined.type):
        prepared_ones = [
            _prepared(examined, fields, instance, member, poses)
            for instance, member in zip(instances, members, strict=True)
        ]
        given = [values | found for values, found in zip(given, prepared_ones, strict=True)]
    numbers = np.empty((len(instances), examined.layout.par_width))
    for name, (offset, shape) in examined.layout.numbers.items():
        column = [values.get(name) for values in given]
        if None in column:
            words = "is missing" if name in fields else "is not among what prepare returned"
            raise PrepareError(members[column.index(None)], f"{name} {words}")
        values = np.asarray(column, dtype=float).reshape(len(instances), -1)
        numbers[:, offset : offset + size(shape)] = values
    return numbers


def _prepares(type_: Any) -> bool:
    """Whether a type defines ``prepare``."""
    return type_.prepare not in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__())


def _prepared(
    examined: Examined,
    fields: Mapping[str, FieldSpec],
    instance: Instance,
    member: int,
    poses: Mapping[int, BodyPose],
) -> dict[str, Any]:
    """What ``prepare`` returns for an instance: the names and shapes that were examined."""
    type_: Any = examined.type
    values = instance.values
    thing = type_(**{n: values[n] for n in fields if n in values})
    if any(spec.kind == "vector2" for spec in fields.values()):
        thing.P_i, thing.P_j = values["P_i"], values["P_j"]
    bodies = {s: poses[b] for s, b in zip(examined.layout.slots, instance.bodies, strict=True)}
    try:
        constants = prepared(thing, bodies)
    except ValueError as error:
        raise PrepareError(member, str(error)) from error
    for name, value in constants.items():
        _, shape = examined.layout.numbers.get(name, (0, None))
        if shape_of(value) != shape:
            raise PrepareError(
                member,
                f"prepare returned {name} of shape {shape_of(value)}, and for random values of the "
                f"fields {'none' if shape is None else shape}; names and shapes must stay the same",
            )
    return constants
