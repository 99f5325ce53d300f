"""Checks the unknowns of its own that a joint type declares."""

from keyword import iskeyword
from typing import Any

from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.element_states import RESERVED, state_lengths
from dap3d_core.interface.element_unknowns import GREATEST, LEAST, START, unknown_names
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.interface.types import Joint, TypeBase


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


def bound_count(type_: type[TypeBase]) -> int:
    """Bounds at which a run ends: two of each unknown that is not periodic."""
    assert issubclass(type_, Joint)
    return 2 * len([name for name in unknown_names(type_) if name not in type_.periodic])


def _check_name(type_: type[Joint], name: Any) -> None:
    who, specs = where_is(type_), specs_of(type_)
    if not (isinstance(name, str) and name.isidentifier() and not iskeyword(name)):
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
