"""Unknowns of their own that joints declare: names, and the fields that they bring.

    unknowns = ("s",)    C, J, gamma, nu and G = dC/ds may name s; gamma s_dot as well

An unknown ``s`` has the fields ``s_0``, near which it is sought at the start, and ``s_min``,
``s_max``, its bounds, unless the type declares these itself.
"""

from collections.abc import Mapping
from typing import Any

from dap3d_core.interface.fields import number

#: Suffixes of the fields of an unknown.
START, LEAST, GREATEST = "_0", "_min", "_max"
#: The bounds of an unknown without bounds.
UNBOUNDED = 1e100


def unknown_names(type_: type) -> tuple[Any, ...]:
    """The unknowns that a type declares; what is no name is kept as it is."""
    declared: Any = getattr(type_, "unknowns", ())
    return (declared,) if isinstance(declared, str) else tuple(declared)


def add_unknown_fields(class_: type) -> None:
    """Give a class that declares unknowns the fields of their starts and bounds."""
    if "unknowns" not in vars(class_):
        return
    own: dict[str, Any] = dict(vars(class_).get("__annotations__", {}))
    inherited: list[Mapping[str, Any]] = [
        vars(base).get("__annotations__", {}) for base in class_.__mro__[1:]
    ]
    for name in unknown_names(class_):
        if not (isinstance(name, str) and name.isidentifier()):
            continue
        for suffix, default, doc in (
            (START, 0.0, f"value near which {name} is sought at the start"),
            (LEAST, -UNBOUNDED, f"least value of {name}"),
            (GREATEST, UNBOUNDED, f"greatest value of {name}"),
        ):
            field = f"{name}{suffix}"
            if field not in own and not any(field in names for names in inherited):
                setattr(class_, field, number(default, doc=doc))
                own[field] = float
    class_.__annotations__ = own
