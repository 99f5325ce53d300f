"""States of their own that joints and forces declare: names, lengths, the fields they bring.

    states = ("z",)          one number
    states = {"z": 3, "q": 1}  by their lengths
    states = {"z": "n"}        as many as a list of the type has entries

The state ``z`` has the fields ``z_0``, its initial value, and ``z_atol``, its absolute tolerance,
unless the type declares these itself. Its kernel ``rate`` returns the derivatives.
"""

from collections.abc import Mapping
from typing import Any

from dap3d_core.interface.fields import number, numbers, vec3

#: Suffixes of the fields of a state.
INITIAL, TOLERANCE = "_0", "_atol"
#: Suffixes of quantities that joint coordinates have: no state is named like one.
_OF_RESULTS = (
    "force", "moment", "force_body", "moment_body", "moment_at_point", "lambda", "actuation",
    "length", "length_rate", "tension", "energy", "angle", "angle_rate",
)  # fmt: skip
#: Names that no state may have: of quantities of results, and of kernel arguments of every type.
RESERVED = frozenset((*_OF_RESULTS, "t", "f", "f_dot", "f_ddot", "lam", "mu", "v_tol", "radius"))

#: Suffixes of the fields of an unknown.
START, LEAST, GREATEST = "_0", "_min", "_max"
#: The bounds of an unknown without bounds.
UNBOUNDED = 1e100


def state_lengths(type_: type) -> dict[str, int]:
    """Length of each state of a type, 1 of a number; what is no name or length is kept as it is."""
    declared: Any = getattr(type_, "states", ())
    if isinstance(declared, Mapping):
        return dict(declared)
    if isinstance(declared, str):
        declared = (declared,)
    return dict.fromkeys(declared, 1)


def state_shape(length: int) -> tuple[int, ...]:
    """Shape of so many numbers of a kernel: a number, or a tuple of them."""
    return () if length == 1 else (length,)


def add_state_fields(class_: type) -> None:
    """Give a class that declares states the fields of their initial values and tolerances."""
    if "states" not in vars(class_):
        return
    fields: dict[str, Any] = {}
    declared = [*vars(class_).values(), *getattr(class_, "__attrs_attrs__", ())]
    specs = (getattr(field, "metadata", {}).get("dap3d") for field in declared)
    sizes = {spec.size for spec in specs if spec is not None}
    for name, length in state_lengths(class_).items():
        if isinstance(name, str) and name.isidentifier() and _is_length(length, sizes):
            fields[f"{name}{INITIAL}"] = _initial(name, length)
            words = f"absolute tolerance of {name}; 0: that of the run"
            fields[f"{name}{TOLERANCE}"] = number(0.0, minimum=0.0, doc=words)
    add_fields(class_, fields)


def add_fields(class_: type, fields: Mapping[str, Any]) -> None:
    """Give a class fields, but for those that it declares."""
    own = dict(vars(class_).get("__annotations__", {}))
    for name, field in fields.items():
        if not any(name in vars(base).get("__annotations__", {}) for base in class_.__mro__):
            setattr(class_, name, field)
            own[name] = Any
    class_.__annotations__ = own


def _is_length(length: Any, sizes: set[str]) -> bool:
    if isinstance(length, str):
        return length in sizes
    return isinstance(length, int) and not isinstance(length, bool) and length > 0


def _initial(name: str, length: int | str) -> Any:
    words = f"initial value of {name}"
    if isinstance(length, str):
        return numbers(length, 0.0, doc=words)
    if length == 1:
        return number(0.0, doc=words)
    zeros = (0.0,) * length
    return vec3(zeros, doc=words) if length == 3 else numbers(length, zeros, doc=words)


def unknown_names(type_: type) -> tuple[Any, ...]:
    """The unknowns that a type declares; what is no name is kept as it is."""
    declared: Any = getattr(type_, "unknowns", ())
    return (declared,) if isinstance(declared, str) else tuple(declared)


def add_unknown_fields(class_: type) -> None:
    """Give a class that declares unknowns the fields of their starts and bounds."""
    if "unknowns" not in vars(class_):
        return
    fields: dict[str, Any] = {}
    for name in unknown_names(class_):
        if not (isinstance(name, str) and name.isidentifier()):
            continue
        for suffix, default, doc in (
            (START, 0.0, f"value near which {name} is sought at the start"),
            (LEAST, -UNBOUNDED, f"least value of {name}"),
            (GREATEST, UNBOUNDED, f"greatest value of {name}"),
        ):
            fields[f"{name}{suffix}"] = number(default, doc=doc)
    add_fields(class_, fields)
