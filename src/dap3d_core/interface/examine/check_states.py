"""Checks the states of its own that a type declares."""

import re
from collections.abc import Mapping
from keyword import iskeyword
from typing import Any

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.element_states import INITIAL, RESERVED, state_lengths, state_shape
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import TypeBase, acts_on_all

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
        if not (isinstance(name, str) and name.isidentifier() and not iskeyword(name)):
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

    Args:
        type_: the type.
        layout: storage of its instances.
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
