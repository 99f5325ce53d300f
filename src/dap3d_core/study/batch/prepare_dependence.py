"""What a type's ``prepare`` looks at: what it does not read cannot change what it returns.

``prepare`` is run once on an element whose fields, and the bodies' poses, note who reads them. With
other values of what was not read it takes the same way through its code and gives the same.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from dap3d_core.interface.body_pose import BodyPose
from dap3d_core.interface.examine.examine import prepared
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import TypeBase
from dap3d_core.scene import Instance


class Dependence(NamedTuple):
    """What the constants of an element depend on.

    Attributes:
        fields: names of its own fields that are read.
        poses: (body index, "r", "p", "A" or "Jp") that are read.
        constants: names of what is returned: these are no copies of fields.
    """

    fields: frozenset[str]
    poses: frozenset[tuple[int, str]]
    constants: frozenset[str]


NOTHING = Dependence(frozenset(), frozenset(), frozenset())


def dependence_of(instance: Instance, poses: Mapping[int, BodyPose], body_count: int) -> Dependence:
    """What ``prepare`` reads of an element; nothing where its type has none.

    Args:
        instance: a checked element.
        poses: of each body index, ground included.
        body_count: for elements that act on each body.
    """
    type_: Any = instance.examined.type
    if type_.prepare in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__()):
        return NOTHING
    slots = instance.examined.layout.slots
    each = bool(getattr(type_, "each_body", False))
    bodies = [(b,) for b in range(1, body_count + 1)] if each else [instance.bodies]
    fields: set[str] = set()
    read: set[tuple[int, str]] = set()
    constants: set[str] = set()
    for of_element in bodies:
        thing = _watched(instance, fields)
        seen = {
            slot: _WatchedPose(poses[body], body, read)
            for slot, body in zip(slots, of_element, strict=True)
        }
        constants |= prepared(thing, seen).keys()
    return Dependence(frozenset(fields), frozenset(read), frozenset(constants))


def _watched(instance: Instance, read: set[str]) -> Any:
    """The element as ``prepare`` gets it, of a class that notes which of its fields are read."""
    type_: Any = instance.examined.type
    specs = specs_of(type_)
    ends = ("P_i", "P_j") if any(s.kind == "vector2" for s in specs.values()) else ()
    names = frozenset((*specs, *ends))

    class Watched(type_):  # type: ignore[misc]
        def __getattribute__(self, name: str) -> Any:
            if name in names:
                read.add(name)
            return super().__getattribute__(name)

    values = {name: value for name, value in instance.values.items() if name in specs}
    thing = Watched(**values)
    for end in ends:
        setattr(thing, end, instance.values[end])
    read.clear()
    return thing


class _WatchedPose(BodyPose):
    """A pose that notes what is read of it."""

    def __init__(self, pose: BodyPose, body: int, read: set[tuple[int, str]]) -> None:
        super().__init__(pose.r, pose.p, pose.A, pose.Jp)
        object.__setattr__(self, "note", (body, read))

    def __getattribute__(self, name: str) -> Any:
        if name in ("r", "p", "A", "Jp"):
            body, read = object.__getattribute__(self, "note")
            read.add((body, name))
        return super().__getattribute__(name)
