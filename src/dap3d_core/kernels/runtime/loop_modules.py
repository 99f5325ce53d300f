"""Group loops: one compiled function that runs a type's kernel over all its instances.

A loop is written as the source of a small module: gather the named quantities of instance q, call
the kernel, store what it returns. All loops have one signature, so that the driver holds them in
one list and is never recompiled for a new type:

    loop(t, arrays, i0, p0, count, out1, out2, out3)

    arrays            body, F, idx, par, states, rates (function_lists.LoopArrays); row 0 of F: no
                      function
    i0, p0            first integer and first number of this group in idx and par
    out1, out2, out3  what the kernels return, flat
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

from dap3d_core.kernels import table_lookup
from dap3d_core.kernels.compiler.trace import trace
from dap3d_core.kernels.compiler.types import Struct
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime import generated_modules, loop_support
from dap3d_core.kernels.runtime.cache import jit_is_on, names_of, unit_of
from dap3d_core.kernels.runtime.function_lists import LOOP, LoopArrays
from dap3d_core.kernels.runtime.source_digest import (
    places,
    reached,
    refuse_outer_references,
    sources,
    sources_of,
)

#: Functions that the text of loops calls.
_SUPPORT = (loop_support.vector_at, loop_support.matrix_at, loop_support.unwound,
            loop_support.doubtful, table_lookup.lookup)  # fmt: skip
_built: dict[str, Callable] = {}
#: Names of the loops that this process had to compile (not those it found in the cache).
compiled_here: list[str] = []


class Loop(NamedTuple):
    """Input of a loop module."""

    name: str  # of the type and what it computes: shown while compiling
    kernels: dict[str, Callable]  # the pure functions, by the name under which ``lines`` call them
    lines: Sequence[str]  # body of the loop for instance q


def source_of(loop: Loop) -> str:
    """The source text of a loop's module, without its kernels (they are put into its namespace)."""
    head = (
        f'"""Group loop of {loop.name}; written by dap3d, do not edit."""\n\n'
        "from dap3d_core.kernels.runtime.loop_support import *\n\n\n"
        "def loop(t, arrays, i0, p0, count, out1, out2, out3):\n"
        "    body, F, idx, par = arrays.body, arrays.F, arrays.idx, arrays.par\n"
        "    for q in range(count):\n"
    )
    return head + "".join(f"        {line}\n" for line in loop.lines)


def build(loop: Loop, announce: Callable[[str], None] | None = None) -> Callable:
    """The compiled loop, from this process, from the cache folder, or compiled now.

    Args:
        loop: what to build.
        announce: called with the loop's name before it is compiled anew.

    Raises:
        CompileError: a kernel does what only numbers can; names its line, and what to do.
    """
    text = source_of(loop)
    ready_name, name = unit_names(loop, text)

    def write(symbols: list[str]) -> tuple[str, list[Any]]:
        if announce is not None:
            announce(loop.name)
        refuse_outer_references(*loop.kernels.values())
        compiled_here.append(loop.name)
        return trace(symbols[0], _module(loop, text, name), array_members()), ["None"]

    if name not in _built:
        if jit_is_on():
            unit = unit_of(name, 1, write, optimise=True, ready_name=ready_name)
            _built.setdefault(name, Entry(unit, 0, LOOP))
        else:
            _built.setdefault(name, _module(loop, text, name)["loop"])
    return _built[name]


def unit_names(loop: Loop, text: str) -> tuple[str, str]:
    """Names of a loop's unit: digests of its text, its sources, and the layout of its arrays."""
    kernels = loop.kernels.values()
    functions, constants = reached(*kernels)  # a kernel may be given others
    return names_of("loop", functions, text, _layout(LoopArrays.type_of()), *places(*kernels),
                    *sources_of(functions, constants), *_support_sources())  # fmt: skip


@cache
def _layout(struct: Struct) -> str:
    return repr(_members(struct))


@cache
def _support_sources() -> list[str | bytes]:
    return sources(*_SUPPORT)


def python_loop(loop: Loop) -> Callable[..., None]:
    """The loop as a Python function."""
    text = source_of(loop)
    return _module(loop, text, unit_names(loop, text)[1])["loop"]


def build_wide(loop: Loop, count: int) -> Entry:
    """The loop for ``count`` scenes of one structure at once (lanes.py).

    Raises:
        CompileError: it decides by a number that differs from scene to scene.
    """
    from dap3d_core.kernels.runtime.lanes import wide_unit

    text = source_of(loop)
    name = f"lanes{count}.{unit_names(loop, text)[1]}"

    def traced(symbol: str) -> str:
        return trace(symbol, _module(loop, text, name), array_members())

    return Entry(wide_unit(name, count, traced, optimise=True), 0, LOOP)


def build_differentiated(loop: Loop, count: int) -> Entry:
    """The loop with derivatives: of each number its value and ``count`` - 1 slopes.

    In plain Python as well, where nothing else is compiled. Time has no slopes: the signature is
    that of all loops.
    """
    from dap3d_core.kernels.compiler.derivatives import differentiate

    text = source_of(loop)
    ready_name, name = (f"slopes{count}.{one}" for one in unit_names(loop, text))

    def write(symbols: list[str]) -> tuple[str, list[Any]]:
        traced = trace(symbols[0], _module(loop, text, name), array_members())
        helpers, define, body = differentiate(traced, count).rpartition("define void @")
        vector = f"<{count} x double>"
        body = body.replace(f"{vector} %t, ", "double %t.0, ", 1)
        start = f"  %t = insertelement {vector} zeroinitializer, double %t.0, i32 0"
        return helpers + define + body.replace("entry:", f"entry:\n{start}", 1), ["None"]

    unit = unit_of(name, 1, write, ready_name=ready_name)
    unit.has_slopes = True
    return Entry(unit, 0, LOOP)


def _module(loop: Loop, text: str, name: str) -> dict[str, Any]:
    namespace = generated_modules.load(None, name, text)
    namespace.update(loop.kernels)
    return namespace


def array_members() -> dict[str, tuple[int, str, int]]:
    """Of each array: its first word in the table, LLVM's type of its items, width of its rows."""
    return _members(LoopArrays.type_of())


def _members(struct: Struct) -> dict[str, tuple[int, str, int]]:
    members, first, widths = {}, 0, {"body": loop_support.BODY_WIDTH, "F": 5}
    for name, type_ in struct.members:
        members[name] = first, type_.item.words[0], widths.get(name, 0)
        first += len(type_.words)
    return members
