"""Writes and compiles the group loops of a type."""

import inspect
from collections.abc import Callable
from typing import Any

from dap3d_core.interface.codegen import loop_source
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.reactions import with_sample_reactions
from dap3d_core.interface.codegen.specialise import bind_friction
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError, is_out_of_memory, where_is
from dap3d_core.interface.fields import sized_fields
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.loop_modules import Loop, build, build_differentiated


def write(type_info: TypeInfo, what: str) -> Loop | None:
    """The loop that computes ``what`` (a key of LOOP_KINDS); None where there is no such kernel."""
    names = loop_source.kernels_of(type_info.type.kind, what)
    if what == "wrench" and loop_source.computes_rate(type_info):
        names = (*names, "rate")
    kernels = {n: k for n, k in type_info.kernels.items() if n in names}
    if what == "impulse" and "impulse" not in kernels:
        return None
    layout = type_info.layout
    wanted = [name for kernel in kernels.values() for name in parameters(kernel)]
    if what in ("angle", "turned"):
        wanted += [n for name in layout.angles for n in (name, f"{name}_dot")]
    if not kernels and not wanted and not (what == "bound" and layout.unknowns):
        return None
    if layout.unknowns:
        from dap3d_core.interface.codegen.unknowns import write_with_unknowns

        return write_with_unknowns(type_info, what, kernels, wanted)
    if what in loop_source.JUMP_KINDS:
        wanted = [n for n in wanted if n not in loop_source.JUMP_NAMES]
    reads = type_info.joints if what in ("friction", "rate") else ()
    lines = list(loop_source.gathering_lines(type_info, wanted, reactions=bool(reads)))
    if what == "angle":
        for name, at in layout.angles.items():
            lines += loop_source.store_angle(name, at)
    elif what == "turned":
        lines += loop_source.append([f"x_{name}" for name in layout.angles])
    if what in loop_source.JUMP_KINDS:
        lines += loop_source.jump_lines(type_info, what, has_rows="J" in kernels)
    for name in kernels if what not in loop_source.JUMP_KINDS else ():
        lines.append(f"out = {loop_source.called_with(type_info, name)}")
        lines += loop_source.store(type_info, name)
    title = f"{type_info.type.keyword}{type_info.given}: {', '.join(kernels) or what}"
    called = {f"kernel_{n}": k for n, k in kernels.items()}
    called |= {f"kernel_J_{joint.field}": joint.type_info.kernels["J"] for joint in reads}
    return Loop(title, called, lines)


def compiled_loop(
    type_info: TypeInfo, what: str, announce: Callable[[str], None] | None = None
) -> Any:
    """The compiled loop of a type for ``what`` (a key of LOOP_KINDS); None where it has none.

    Args:
        type_info: the type, which keeps it: names of units are digests of all their sources.
        what: the kind of the loop.
        announce: called with the loop's name before it is compiled.

    Raises:
        PluginError: it cannot be compiled; names file, type, kernels, line, reason and remedy.
    """
    if what not in type_info.loops:
        type_info.loops[what] = _compiled_loop(type_info, what, announce)
    return type_info.loops[what]


def differentiated_loop(type_info: TypeInfo, what: str, count: int) -> Entry:
    """A loop that a type has, with derivatives (``build_differentiated``); kept as well."""
    key = what, count
    if key not in type_info.loops:
        loop = write(type_info, what)
        assert loop is not None
        type_info.loops[key] = build_differentiated(loop, count)
    return type_info.loops[key]


def _compiled_loop(type_info: TypeInfo, what: str, announce: Callable[[str], None] | None) -> Any:
    loop = write(type_info, what)
    if loop is None:
        return None
    try:
        return build(loop, announce)
    except Exception as error:
        if is_out_of_memory(error):
            raise MemoryError from error
        if isinstance(error, OSError):  # of the surroundings: no fault of the type
            raise
        raise PluginError(
            f"{where_is(type_info.type)}: its kernels cannot be compiled ({loop.name}): {error}. "
            "A kernel is plain: tuples of numbers, the functions of dap3d_core.kernels, where() "
            "for branches"
        ) from error


def compile_all(type_info: TypeInfo) -> None:
    """Compile all loops of a type, of its variants, and of its friction that sticks.

    Except kernels that call a function of an argument, and those of types with lists: they are
    compiled with the function and the lengths of a scene.

    Raises:
        PluginError: one of them cannot be compiled.
    """
    if not _calls_functions(type_info) and not sized_fields(type_info.type):
        for what in loop_source.LOOP_KINDS:
            if what != "friction":
                compiled_loop(with_sample_reactions(type_info), what)
        if type_info.type.kind == "joint" and "friction" in type_info.kernels:
            compiled_loop(bind_friction(type_info), "friction")
    for _, variant in type_info.variants:
        compile_all(variant)
    if grips := getattr(type_info.type, "grips", ()):
        from dap3d_core.interface.examine.examine import examine

        for grip in grips:
            compile_all(examine(grip))


def _calls_functions(type_info: TypeInfo) -> bool:
    callable_names = {n for n, q in type_info.names.items() if q.derivative >= 0}
    return any(callable_names & set(inspect.signature(k).parameters)
               for k in type_info.kernels.values())  # fmt: skip
