"""Finds what a type's ``prepare`` reads: nothing else can change what it returns.

``prepare`` is run once on an element whose fields, and the bodies' poses, record that they are
read. With other values of what was not read it takes the same way through its code.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from dap3d_core.interface.body_pose import BodyPose
from dap3d_core.interface.examine.examine import prepared
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import TypeBase, acts_on_all, turns_of
from dap3d_core.scene import Instance


class Dependence(NamedTuple):
    """Dependence of the constants of an element.

    Attributes:
        fields: names of its own fields that are read.
        poses: (body index, "r", "p", "A" or "Jp") that are read.
        constants: names of the constants, which are no copies of fields.
    """

    fields: frozenset[str]
    poses: frozenset[tuple[int, str]]
    constants: frozenset[str]


def dependence_of(instance: Instance, poses: Mapping[int, BodyPose], body_count: int) -> Dependence:
    """Fields and poses that ``prepare`` reads for an element; none where its type has none.

    Args:
        instance: a checked element.
        poses: of each body index, ground included.
        body_count: for elements that act on each body.
    """
    type_: Any = instance.type_info.type
    fields: set[str] = set()
    read: set[tuple[int, str]] = set()
    constants: set[str] = set()
    if type_.prepare not in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__()):
        slots = instance.type_info.layout.slots
        each = acts_on_all(type_)
        for bodies in turns_of(type_, body_count) if each else [instance.bodies]:
            recorded = {
                slot: _RecordedPose(poses[body], body, read)
                for slot, body in zip(slots, bodies, strict=True)
            }
            constants |= prepared(_recorded(instance, fields), recorded).keys()
    return Dependence(frozenset(fields), frozenset(read), frozenset(constants))


def _recorded(instance: Instance, read: set[str]) -> Any:
    """The element as ``prepare`` gets it, of a class that records reads of its fields."""
    type_: Any = instance.type_info.type
    specs = specs_of(type_)
    ends = ("P_i", "P_j") if any(s.kind == "vector2" for s in specs.values()) else ()
    names = frozenset((*specs, *ends))
    initial = set(read)

    class Recorded(type_):  # type: ignore[misc]
        def __getattribute__(self, name: str) -> Any:
            if name in names:
                read.add(name)
            return super().__getattribute__(name)

    element = Recorded(**{name: v for name, v in instance.values.items() if name in specs})
    for end in ends:
        setattr(element, end, instance.values[end])
    read.intersection_update(initial)  # without what its construction has read
    return element


class _RecordedPose(BodyPose):
    """A pose that records what is read of it."""

    def __init__(self, pose: BodyPose, body: int, read: set[tuple[int, str]]) -> None:
        super().__init__(pose.r, pose.p, pose.A, pose.Jp)
        object.__setattr__(self, "note", (body, read))

    def __getattribute__(self, name: str) -> Any:
        if name in ("r", "p", "A", "Jp"):
            body, read = object.__getattribute__(self, "note")
            read.add((body, name))
        return super().__getattribute__(name)
