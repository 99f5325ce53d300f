"""Forces that read reactions: their groups, bound to the joints that a scene names."""

import random
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

import attrs
import numpy as np

from dap3d_core.interface.codegen import reactions
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import line_of
from dap3d_core.interface.examine.random_values import random_quantity
from dap3d_core.model.groups import Group, PrepareError, each
from dap3d_core.scene import Instance


def bound_to_joints(
    groups: Sequence[Group],
    forces: Sequence[Instance],
    joint_groups: Sequence[Group],
    joints: Sequence[Instance],
) -> tuple[Group, ...]:
    """Groups of forces; those whose types read reactions with the numbers of the joints behind.

    Raises:
        PrepareError: a joint has not the rows that a type reads: all such forces.
        PluginError: a type cannot read the reaction of a joint.
    """
    places = {
        joints[member].name: (n, k)
        for n, group in enumerate(joint_groups)
        for k, member in enumerate(group.members.tolist())
    }

    def bound(group: Group) -> list[Group]:
        fields = reactions.joints_read(group.type_info)
        if not fields:
            return [group]
        named = [[forces[member].values[f] for f in fields] for member in group.members.tolist()]
        if wrong := list(_wrong_rows(group, fields, named, places, joint_groups)):
            raise PrepareError(*wrong)
        at = [[places[name] for name in names] for names in named]
        return list(_by_joints(group, fields, at, joint_groups))

    return tuple(chain.from_iterable(each(bound, groups)))


def _by_joints(
    group: Group,
    fields: Sequence[str],
    at: Sequence[Sequence[tuple[int, int]]],
    joint_groups: Sequence[Group],
) -> Iterator[Group]:
    """The instances of a group by the groups of their joints; at: group and index of each joint."""
    sorted_: dict[tuple[int, ...], list[int]] = {}
    for k, of_instance in enumerate(at):
        sorted_.setdefault(tuple(n for n, _ in of_instance), []).append(k)
    for which, instances in sorted_.items():
        part = group.take(np.array(instances, dtype=np.int64))
        joints = tuple(
            joint_groups[n].take(np.array([at[k][f][1] for k in instances], dtype=np.int64))
            for f, n in enumerate(which)
        )
        types = {field: j.type_info for field, j in zip(fields, joints, strict=True)}
        yield _with_joints(part, reactions.bind_joints(group.type_info, types), joints)


def _wrong_rows(
    group: Group,
    fields: Sequence[str],
    named: Sequence[Sequence[str]],
    places: Mapping[str, tuple[int, int]],
    joint_groups: Sequence[Group],
) -> Iterator[tuple[int, str]]:
    """Forces with a joint that has other rows than their type takes, in words."""
    specs = reactions.joint_fields(group.type_info.type)
    refused: dict[tuple[int, ...], str] = {}
    for member, names in zip(group.members.tolist(), named, strict=True):
        rows = tuple(joint_groups[places[name][0]].type_info.row_count for name in names)
        if rows not in refused:
            refused[rows] = ""
            for field, count in zip(fields, rows, strict=True):
                declared = specs[field].rows
                if declared is not None and declared != count:
                    refused[rows] = f"{field} is to be a joint of {_rows(declared)}"
            counts = dict(zip(fields, rows, strict=True))
            refused[rows] = refused[rows] or _refusal(group, counts)
        if refused[rows]:
            owned = ", ".join(f"{n} has {_rows(c)}" for n, c in zip(names, rows, strict=True))
            yield member, f"{refused[rows]}; joint {owned}"


def _refusal(group: Group, rows: Mapping[str, int]) -> str:
    """How a kernel fails with so many multipliers of each joint; "" where none does."""
    rng = random.Random(1)
    offered = reactions.reaction_names(group.type_info.type, rows) | group.type_info.names
    kernels = group.type_info.kernels
    for name, kernel in ((name, kernels[name]) for name in reactions.READING if name in kernels):
        try:
            kernel(*(random_quantity(offered[n], rng) for n in parameters(kernel)))
        except (IndexError, ValueError, TypeError) as error:
            words = f"{type(error).__name__}: {error}{line_of(error, kernel)}"
            return f"its {name} does not take the multipliers of this joint ({words})"
        except ArithmeticError:  # undefined for these random numbers, as others may be
            continue
    return ""


def _rows(count: int) -> str:
    return f"{count} row{'s' if count > 1 else ''}"


def _with_joints(group: Group, type_info: TypeInfo, joints: tuple[Group, ...]) -> Group:
    """A group with the numbers and tables of joints behind its own."""
    numbers, tables, width = [group.numbers], list(group.tables), group.numbers.shape[1]
    for joint in joints:
        numbers.append(joint.numbers)
        tables += [(k, width + offset, rows) for k, offset, rows in joint.tables]
        width += joint.numbers.shape[1]
    return attrs.evolve(
        group, type_info=type_info, numbers=np.hstack(numbers), tables=tuple(tables), read=joints
    )
