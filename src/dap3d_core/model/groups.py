"""Instances of one type, side by side: what one group loop runs over."""

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.checks import BodyPose, Examined, prepared
from dap3d_core.interface.fields import specs_of
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
    examined, count = instances[0].examined, len(instances)
    constants = _prepare_all(examined, instances, members, poses)
    numbers = np.empty((count, examined.layout.par_width))
    for name, (offset, shape) in examined.layout.numbers.items():
        if constants and name in constants[0]:
            column = [c[name] for c in constants]
        else:
            column = [instance.values[name] for instance in instances]
        values = np.asarray(column, dtype=float).reshape(count, -1)
        numbers[:, offset : offset + size(shape)] = values
    bodies = np.array([i.bodies for i in instances], dtype=np.int64).reshape(count, -1)
    functions = np.array([i.functions for i in instances], dtype=np.int64).reshape(count, -1)
    places = np.array(members, dtype=np.int64)
    if getattr(examined.type, "each_body", False):
        bodies = np.tile(np.arange(1, body_count + 1), count)[:, None]
        numbers = np.repeat(numbers, body_count, axis=0)
        functions = np.repeat(functions, body_count, axis=0)
        places = np.repeat(places, body_count)
    return Group(examined, places, bodies, functions, numbers)


def _prepare_all(
    examined: Examined, instances: list[Instance], members: list[int], poses: Mapping[int, BodyPose]
) -> list[dict[str, Any]]:
    """What ``prepare`` returns for each instance; empty where the type does not define it."""
    type_: Any = examined.type
    if type_.prepare in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__()):
        return []
    fields = specs_of(type_)
    has_vector2 = any(spec.kind == "vector2" for spec in fields.values())
    result = []
    expected = None
    for member, instance in zip(members, instances, strict=True):
        values = instance.values
        thing = type_(**{n: values[n] for n in fields if n in values})
        if has_vector2:
            thing.P_i, thing.P_j = values["P_i"], values["P_j"]
        bodies = {s: poses[b] for s, b in zip(examined.layout.slots, instance.bodies, strict=False)}
        try:
            constants = prepared(thing, bodies)
        except ValueError as error:
            raise PrepareError(member, str(error)) from error
        shapes = {n: shape_of(v) for n, v in constants.items()}
        for name, spec in fields.items():
            if spec.kind == "number" and name in examined.layout.numbers and name not in constants:
                if values.get(name) is None:
                    raise PrepareError(member, f"{name} needs a number")
                constants[name], shapes[name] = values[name], ()
        if expected is None:
            expected = shapes
        elif shapes != expected:
            raise PrepareError(
                member, "prepare returned other names or shapes than for the first of its kind"
            )
        result.append(constants)
    return result
