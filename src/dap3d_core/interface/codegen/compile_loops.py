"""Compiles the group loops of a type."""

import inspect
from collections.abc import Callable
from typing import Any

from dap3d_core.interface.codegen.loop_source import LOOP_KINDS, write
from dap3d_core.interface.codegen.reactions import with_sample_reactions
from dap3d_core.interface.codegen.specialise import bind_friction
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.kernels.runtime.loop_modules import build


def compiled_loop(
    type_info: TypeInfo, what: str, announce: Callable[[str], None] | None = None
) -> Any:
    """The compiled loop of a type for ``what`` (a key of LOOP_KINDS); None where it has none.

    Args:
        examined: the type.
        what: the kind of the loop.
        announce: called with the loop's name before it is compiled.

    Raises:
        PluginError: it cannot be compiled; names file, type, kernels, line, reason and remedy.
    """
    loop = write(type_info, what)
    if loop is None:
        return None
    try:
        return build(loop, announce)
    except Exception as error:
        raise PluginError(
            f"{where_is(type_info.type)}: its kernels cannot be compiled ({loop.name}): {error}. "
            "A kernel is plain: tuples of numbers, the words of dap3d_core.kernels, where() for "
            "branches"
        ) from error


def compile_all(type_info: TypeInfo) -> None:
    """Compile all loops of a type and of its variants.

    Except kernels that call a function of an argument: they are compiled with the function of a
    scene.

    Raises:
        PluginError: one of them cannot be compiled.
    """
    if not _calls_functions(type_info):
        for what in LOOP_KINDS:
            if what != "friction":
                compiled_loop(with_sample_reactions(type_info), what)
        if type_info.type.kind == "joint" and "friction" in type_info.kernels:
            compiled_loop(bind_friction(type_info), "friction")
    for _, variant in type_info.variants:
        compile_all(variant)


def _calls_functions(type_info: TypeInfo) -> bool:
    callable_names = {n for n, q in type_info.names.items() if q.derivative >= 0}
    return any(callable_names & set(inspect.signature(k).parameters)
               for k in type_info.kernels.values())  # fmt: skip
