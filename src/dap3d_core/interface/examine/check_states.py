"""Checks the states of its own that a type declares."""

import re
from collections.abc import Mapping
from typing import Any

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.codegen.kernel_arguments import can_be_parameter, parameters
from dap3d_core.interface.element_states import (
    GREATEST,
    INITIAL,
    LEAST,
    RESERVED,
    START,
    state_lengths,
    state_shape,
    unknown_names,
)
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.interface.types import Joint, TypeBase, acts_on_all

#: Coordinates of joints and their rates, which are quantities as well.
_COORDINATE = re.compile(r"q[1-9]\d?(_dot)?")


def check_states(type_: type[TypeBase], *, is_abstract: bool = False) -> None:
    """Refuses names and lengths that no state can have, and states without a rate.

    Raises:
        PluginError: with file, type, state and remedy.
    """
    who, lengths = where_is(type_), state_lengths(type_)
    has_rate = "rate" in type_.kernels()
    if has_rate and not lengths:
        raise PluginError(f'{who} defines rate, but no states; add e.g. states = ("z",)')
    if not lengths:
        return
    if type_.kind == "function":
        raise PluginError(f"{who}: a function has no states; declare them in a force or a joint")
    if acts_on_all(type_):
        raise PluginError(
            f"{who} acts on each body, and declares states: whose they are is open; "
            "declare body_i, and one element for each body"
        )
    for name, length in lengths.items():
        if not can_be_parameter(name):
            raise PluginError(f"{who}: {name!r} in states is no name that a kernel can take")
        if not isinstance(length, int) or isinstance(length, bool) or length < 1:
            raise PluginError(
                f"{who}: states[{name!r}] is its length, a whole number from 1 on, not {length!r}"
            )
    if not is_abstract and not has_rate:
        names = ", ".join(lengths)
        raise PluginError(f"{who} declares the states {names}, but no rate, which returns theirs")
    specs = specs_of(type_)
    for name, length in lengths.items():
        spec = specs.get(f"{name}{INITIAL}")
        shape = {"number": (), "vec3": (3,), "numbers": (getattr(spec, "columns", 0),)}
        if spec is None or shape.get(spec.kind) != state_shape(length):
            wanted = {1: "number", 3: "vec3"}.get(length, f"numbers({length}, ...)")
            kind = "no field" if spec is None else spec.kind
            raise PluginError(
                f"{who}.{name}{INITIAL} is the initial value of {name}, of {length} numbers; "
                f"it is {kind}: declare it by {wanted}, or leave it out"
            )


def check_state_names(
    type_: type[TypeBase], layout: InstanceLayout, others: Mapping[str, Any]
) -> None:
    """Refuses states with names that kernels or results have for something else.

    others: the names its fields offer.

    Raises:
        PluginError: with file, type, name and remedy.
    """
    who = where_is(type_)
    for name in state_lengths(type_):
        reason = ""
        if name in layout.constants:
            reason = "what prepare returns under this name"
        elif name in specs_of(type_):
            reason = "its field of this name"
        elif name in layout.slots or name in others:
            reason = "what its bodies and fields offer under this name"
        elif name in RESERVED or _COORDINATE.fullmatch(name):
            reason = "the quantity of this name that elements have"
        elif name.endswith(INITIAL) and name[: -len(INITIAL)] in state_lengths(type_):
            reason = "an initial value"
        if reason:
            raise PluginError(f"{who}: the state {name} would hide {reason}; take another name")


def check_unknowns(type_: type[TypeBase]) -> None:
    """Refuses names that no unknown can have, and unknowns that the rows do not determine.

    Raises:
        PluginError: with file, type, unknown and remedy.
    """
    who, unknowns = where_is(type_), unknown_names(type_)
    kernels = type_.kernels()
    if not issubclass(type_, Joint):
        if unknowns:
            raise PluginError(f"{who}: only a joint has rows to find unknowns by, {unknowns!r}")
        return
    if not unknowns:
        if "G" in kernels:
            raise PluginError(f'{who} defines G, but no unknowns; add e.g. unknowns = ("s",)')
        return
    for name in unknowns:
        _check_name(type_, name)
    for name in type_.periodic:
        if name not in unknowns:
            raise PluginError(f"{who}: periodic names {name!r}, which is none of its unknowns")
    if "friction" in kernels:
        raise PluginError(
            f"{who} has unknowns and friction; let a force rub that reads the multipliers of the "
            "joint, by a field joint()"
        )
    if jumps := [name for name in ("impulse", "reset") if name in kernels]:
        raise PluginError(
            f"{who} has unknowns and {jumps[0]}, which knows only rows of bodies; let a force jump"
        )
    if "C" not in kernels:
        return  # which is refused in words of its own
    rows = len(type_.position_rows())
    if rows < len(unknowns):
        raise PluginError(
            f"{who} has {rows} rows of the position level, too few to find its {len(unknowns)} "
            f"unknowns {', '.join(unknowns)} by"
        )
    for name in unknowns:
        if name not in parameters(kernels["C"]):
            raise PluginError(f"{who}.C does not name {name}, which is to be found by its rows")
        if "C_dot" in kernels and f"{name}_dot" in parameters(kernels["C_dot"]):
            raise PluginError(f"{who}.C_dot is to be linear in the velocities; it names {name}_dot")


def _check_name(type_: type[Joint], name: Any) -> None:
    who, specs = where_is(type_), specs_of(type_)
    if not can_be_parameter(name):
        raise PluginError(f"{who}: {name!r} in unknowns is no name that a kernel can take")
    if name in specs or name in RESERVED or name in state_lengths(type_) or slot_of(name):
        raise PluginError(
            f"{who}: the unknown {name} would hide a field, a quantity or what a body has under "
            "this name; take another name"
        )
    for suffix in (START, LEAST, GREATEST):
        spec = specs.get(f"{name}{suffix}")
        if spec is None or spec.kind != "number" or spec.default is None:
            raise PluginError(
                f"{who}.{name}{suffix} is a number that belongs to the unknown {name}; declare it "
                "by number(), or leave it out"
            )
