"""Laws that steps may pass over, because their types do not say where they change."""

from collections.abc import Iterator
from typing import Any

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.kernels import lookup, where
from dap3d_core.kernels.runtime.source_digest import reached
from dap3d_core.model.knots import breaks_are_told
from dap3d_core.result import information
from dap3d_core.scene import ValidatedScene

#: Words of kernels that choose between formulas.
CHOOSING = (where, lookup)
#: Kernels that make the law of a force.
LAWS = ("wrench", "energy")


def notes_on_laws(checked: ValidatedScene) -> list[str]:
    """Functions of an argument, and laws with branches, that do not say where they change."""
    functions = {function.name: function for function in checked.functions}
    elements = (*checked.joints, *checked.forces)
    called = dict.fromkeys(
        name
        for element in elements
        for field in element.type_info.argument_functions
        if (name := element.values[field]) is not None
    )
    found = [
        f"functions.{name} ({functions[name].type_info.type.keyword}): its type says neither where "
        "it takes another form (breaks) nor that it does not (smooth): steps may pass over what it "
        "does over a short way"
        for name in called
        if not breaks_are_told(functions[name])
    ]
    by_type: dict[Any, list[str]] = {}
    for element in checked.forces:
        by_type.setdefault(element.type_info.type, []).append(element.name)
    type_info = {force.type_info.type: force.type_info for force in checked.forces}
    return [*found, *_branching(by_type, type_info)]


def _branching(by_type: dict[Any, list[str]], type_info: dict[Any, TypeInfo]) -> Iterator[str]:
    for type_, names in by_type.items():
        kernels = type_info[type_].kernels
        if "switch" in kernels or not _chooses(type_info[type_]):
            continue
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        yield (
            information(
                f"{type_.kind}s.{names[0]}{more} ({type_.keyword}): its law has branches "
                "and its type no switch: steps go across them, and may pass over a short one"
            )
        )


def _chooses(type_info: TypeInfo) -> bool:
    """True if a law of a type chooses between formulas."""
    laws = [type_info.kernels[name] for name in LAWS if name in type_info.kernels]
    return any(
        word in (plain.__globals__.get(name) for name in plain.__code__.co_names)
        for plain in reached(*laws)[0]
        for word in CHOOSING
    )
