"""Group loops: one compiled function that runs a type's kernel over all its instances.

A loop is written as the source of a small module: gather the named quantities of instance q, call
the kernel, store what it returns. All loops have one signature, so that the driver holds them in
one list and is never recompiled for a new type:

    loop(t, arrays, i0, p0, count, out1, out2, out3)

    arrays            body, F, idx, par (lists.LoopArrays); row 0 of F is the absent function
    i0, p0            where this group's integers and numbers begin in idx and par
    out1, out2, out3  what the kernels return, flat (by_address.pointer)
"""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from dap3d_core.kernels import gather, written
from dap3d_core.kernels.cache import (
    cache_folder,
    compiled_in,
    digest,
    identities,
    jit_is_on,
    reached,
    sources,
)
from dap3d_core.kernels.inline import inlined
from dap3d_core.kernels.lists import LOOP


class Loop(NamedTuple):
    """What a loop module is written from."""

    name: str  # of the type and what it computes: shown while compiling
    kernels: dict[str, Callable]  # the pure functions, by the name under which ``lines`` call them
    lines: Sequence[str]  # body of the loop for instance q


def source_of(loop: Loop) -> str:
    """The source text of a loop's module, without its kernels (they are put into its namespace)."""
    head = (
        f'"""Group loop of {loop.name}; written by dap3d, do not edit."""\n\n'
        "from dap3d_core.kernels.gather import *\n\n\n"
        "def loop(t, arrays, i0, p0, count, out1, out2, out3):\n"
        "    body, F, idx, par = arrays.body, arrays.F, arrays.idx, arrays.par\n"
        "    for q in range(count):\n"
    )
    return head + "".join(f"        {line}\n" for line in loop.lines)


_built: dict[str, Callable] = {}
#: Held while a loop is built, which several threads may ask for at once.
_building = threading.Lock()
#: Names of the loops that this process had to compile (not those it found in the cache).
compiled_here: list[str] = []


def build(loop: Loop, announce: Callable[[str], None] | None = None) -> Callable:
    """The compiled loop, from this process, from the cache folder, or compiled now.

    Args:
        loop: what to build.
        announce: called with the loop's name before it is compiled anew.
    """
    text = source_of(loop)
    gathering = (gather.vector_at, gather.matrix_at, gather.unwound, gather.doubtful)
    kernels = loop.kernels.values()
    key = digest(text, *identities(*kernels), *sources(*kernels, *gathering))
    with _building:
        if key not in _built:
            _built[key] = _build(loop, text, f"loop-{key}", announce)
        return _built[key]


def _build(loop: Loop, text: str, name: str, announce: Callable[[str], None] | None) -> Callable:
    folder = cache_folder()
    path = written.write(name, text) if jit_is_on() else None
    namespace = written.load(path, name, text)
    namespace.update(loop.kernels)
    for plain in reached(*loop.kernels.values())[0]:  # kernels and the author's own helpers
        inlined(plain)
    function = compiled_in(None if path is None else folder, name, namespace["loop"])
    if jit_is_on():
        if announce is not None and not _is_cached(folder, name):
            announce(loop.name)
        function.compile(LOOP)
        if not function.stats.cache_hits:
            compiled_here.append(loop.name)
    return function


def _is_cached(folder: Path | None, name: str) -> bool:
    return folder is not None and any((folder / name).glob("*/*.nbc"))
