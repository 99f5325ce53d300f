"""Joints whose rows are kept whatever their poses, and the reasons in words."""

from inspect import signature
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Integers
from dap3d_core.interface.codegen.instance_layout import prefix_of
from dap3d_core.interface.codegen.kernel_arguments import DERIVATIVES
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.element_states import unknown_names
from dap3d_core.model import Group

#: Rows from which on joint coordinates cost less than the body coordinates and rows they replace.
LEAST_ROWS = 3
#: Kernels of the rows themselves.
_ROWS = ("C", "C_dot", "J", "gamma", "nu")

ON_TIME = "its rows depend on time"
ON_STATES = "its rows depend on states of its own"
NOT_CLOSED = "no pose with C = 0 was found from the one given"
DEPENDENT = "its rows depend on each other where C = 0"
NOT_CONSTANT = "the axes of its free motions are constant in neither body"
NOT_INVARIANT = "its rows depend on where ground is"


def refusal_of(type_info: TypeInfo) -> str:
    """The reason why no joint of a type has a known motion, from its declaration; "" for none."""
    type_: Any = type_info.type
    slots = len(type_info.layout.slots)
    if slots > 2:
        return f"it joins {('three', 'four')[slots - 3] if slots < 5 else slots} bodies"
    if unknowns := unknown_names(type_):
        return f"it has unknowns of its own: {', '.join(unknowns)}"
    if type_.velocity_rows():
        return "it has rows of the velocity level"
    if "t" in _names_in_rows(type_info):
        return ON_TIME
    if _names_in_rows(type_info) & type_info.layout.states.keys():
        return ON_STATES
    if type_.rows < LEAST_ROWS:
        rows = "1 row costs" if type_.rows == 1 else f"{type_.rows} rows cost"
        return f"its {rows} less than {6 - type_.rows} joint coordinates"
    return ""


def refused_joints(group: Group) -> dict[int, str]:
    """Reasons for joints of a group by their places in the model; those that have one."""
    reasons: dict[int, str] = {}
    if reason := refusal_of(group.type_info):
        reasons = dict.fromkeys(group.members.tolist(), reason)
    return reasons | dict.fromkeys(group.members[_depends_on_time(group)].tolist(), ON_TIME)


def two_bodies(group: Group) -> Integers:
    """(m, 2) the bodies of the two slots; ground where a type has one."""
    bodies = np.zeros((group.count, 2), dtype=np.int64)
    bodies[:, : group.bodies.shape[1]] = group.bodies
    return bodies


def two_slots(group: Group) -> tuple[str, str]:
    """The slots of the two bodies; "ground" where a type has one."""
    i, j = (*group.type_info.layout.slots, "ground")[:2]
    return i, j


def _depends_on_time(group: Group) -> Any:
    """(m,) True for joints whose rows take a function of time that they are given."""
    names = _names_in_rows(group.type_info)
    depends = np.zeros(group.count, dtype=bool)
    for column, field in enumerate(group.type_info.layout.functions):
        f = prefix_of(group.type_info.type, field)
        if names & {field, *(f"{f}{suffix}" for suffix in (*DERIVATIVES, "_0"))}:
            depends |= group.functions[:, column] > 0
    return depends


def _names_in_rows(type_info: TypeInfo) -> set[str]:
    kernels = (k for n, k in type_info.kernels.items() if n in _ROWS)
    return {name for kernel in kernels for name in signature(kernel).parameters}
