"""Compiled functions and arrays with a vector for each float: scenes, or a value and derivatives.

Sources are those of one scene (kernels/compiler/lanes.py, derivatives). Scenes of one structure
are one in each lane, and have the bits of each alone; or lane 0 is a number, with the bits that it
has alone, and the others are its derivatives. Item k of all lanes lies together.
"""

import ctypes
import functools
import inspect
from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.derivatives import differentiate
from dap3d_core.kernels.compiler.derivatives.instructions import layout
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.lanes import widen
from dap3d_core.kernels.compiler.types import COMPLEX, FLOAT, Signature, Struct, Tuple
from dap3d_core.kernels.compiler.units import Entry, Functions, Unit, address_of, type_of
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.cache import names_of, unit_of
from dap3d_core.kernels.runtime.source_digest import origin

#: Numbers at whose multiples arrays begin: those of a register of the widest vectors.
ALIGNMENT = 8
#: Of each array that owns its memory: its numbers, and those of all lanes.
Buffers = dict[int, tuple[Floats, Floats]]


@functools.cache
def lane_count() -> int:
    """Scenes that this processor computes best at once: the numbers of a register, at least 4."""
    return 8 if "+avx512f" in objects.processor().features.split(",") else 4


def wide_function(function: Any, arguments: tuple[Any, ...], count: int) -> Entry:
    """A function of the core for ``count`` scenes; its arguments are structs and tables.

    Raises:
        CompileError: it decides by a number that differs from scene to scene.
    """
    plain = inspect.unwrap(function)
    parts = [repr(arguments), f"{plain.__module__}.{plain.__qualname__}", *origin([plain])]

    def text(symbol: str) -> str:
        program = Program()
        program.export(function, arguments, symbol)
        return program.module()

    name = names_of(f"lanes.{plain.__name__}", [plain], str(count), *parts)[1]
    return Entry(wide_unit(name, count, text, optimise=False), 0, Signature(arguments))


def wide_unit(name: str, count: int, text: Callable[[str], str], *, optimise: bool) -> Unit:
    """A unit of one function for ``count`` scenes, from the cache folder or compiled now.

    Args:
        name: contains a digest of everything that decides the code.
        count: scenes.
        text: makes the LLVM IR for one scene, given the function's symbol.
        optimise: compile optimised code at once; for short code.

    Raises:
        CompileError: the function decides by a number that differs from scene to scene.
    """

    def write(symbols: list[str]) -> tuple[str, list[Any]]:
        return widen(text(symbols[0]), count), ["None"]

    return unit_of(name, 1, write, optimise=optimise)


def differentiated(entry: Entry, count: int) -> Entry:
    """A compiled function whose floats are ``count`` numbers: a value, and derivatives."""
    unit = entry.unit
    if unit.has_slopes:  # of a table that is called where values alone are computed
        return entry

    def write(symbols: list[str]) -> tuple[str, list[Any]]:
        return differentiate(unit.fresh_text(symbols), count), unit.results

    wide = unit_of(f"{unit.name}-d{count}", len(unit.symbols), write)
    wide.has_slopes = True
    return Entry(wide, entry.k, entry.signature)


class ValueFunctions:
    """A table of functions that compute values alone, for differentiated code.

    They run on the plain arrays; what they change has no slopes.

    Attributes:
        address: of the table.
    """

    def __init__(self, table: Functions, run: Callable[..., None]) -> None:
        """Args: the plain functions; runs one of them, given it and addresses of its arguments."""
        words = [ctypes.c_void_p for type_ in table.signature.arguments for _ in type_.words]
        kind = ctypes.CFUNCTYPE(None, *words)
        self._calls = [kind(functools.partial(run, entry)) for entry in table.entries]
        addresses = [ctypes.cast(call, ctypes.c_void_p).value or 0 for call in self._calls]
        self._addresses = np.array(addresses, dtype=np.int64)
        self.address = address_of(self._addresses)


class WideArrays:
    """A struct of arrays for several scenes; integers and what is not named it shares with one.

    Attributes:
        type: of the struct in compiled code; its lengths are those of one scene.
        address: of its table.
    """

    def __init__(
        self,
        arrays: Arrays,
        count: int,
        names: Collection[str] | None,
        buffers: Buffers | None = None,
    ) -> None:
        """Args:
        arrays: of one scene.
        count: scenes.
        names: arrays of floats that each scene has for itself, those of further structs behind a
            dot; None: all. Wide code may read no other.
        buffers: of other structs, which may share memory with this one.
        """
        self.type, self._count = arrays.type_of(), count
        self._buffers: Buffers = {} if buffers is None else buffers
        self._tables: list[Any] = []
        self.address = self._table(arrays, names, "")

    def _table(self, arrays: Arrays, names: Collection[str] | None, before: str) -> int:
        words: list[int] = []
        for name, type_ in arrays.type_of().members:
            array = getattr(arrays, name)
            if isinstance(type_, Struct):
                has = array is not None
                words.append(self._table(array, names, f"{before}{name}.") if has else 0)
                continue
            own = (names is None or before + name in names) and type_.item in (FLOAT, COMPLEX)
            words += [address_of(self.matrix(array) if own else array), *array.shape]
        self._tables.append(np.array(words, dtype=np.int64))
        return address_of(self._tables[-1])

    def matrix(self, array: Floats) -> Floats:
        """(size, count) view: the items of an array of one scene, for each scene.

        Arrays that lie in one array of one scene do so here. A complex number is two items.
        """
        whole = array if array.base is None else array.base
        if id(whole) not in self._buffers:
            numbers = np.zeros(whole.nbytes // 8 * self._count + ALIGNMENT)
            first = -address_of(numbers) // 8 % ALIGNMENT
            end = first + whole.nbytes // 8 * self._count
            flat = whole.reshape(-1).view(np.float64)
            self._buffers[id(whole)] = flat, numbers[first:end].reshape(-1, self._count)
        wide = self._buffers[id(whole)][1]
        first = (address_of(array) - address_of(whole)) // 8 if array.size else 0
        return wide[first : first + array.nbytes // 8]

    def spread(self) -> None:
        """Give each scene the numbers of the one."""
        for flat, wide in self._buffers.values():
            wide[:] = flat.reshape(-1, 1)


class DifferentiatedArrays(WideArrays):
    """A struct of arrays with derivatives: of each number its value and ``count`` - 1 slopes.

    Slopes are zero at first. The numbers themselves stay those of the plain arrays wherever Python
    reads or changes them, if ``take`` comes before each call of differentiated code, ``give`` after
    it.
    """

    def __init__(self, arrays: Arrays, count: int, buffers: Buffers | None = None) -> None:
        """Args: the arrays; numbers for each of theirs; those of other structs, to be shared."""
        width, self._first = layout(count)
        self._lanes = slice(self._first, self._first + count - 1)
        super().__init__(arrays, width, None, buffers)

    def matrix(self, array: Floats) -> Floats:
        """As of ``WideArrays``; with the numbers of the array, where it is new."""
        known = len(self._buffers)
        matrix = super().matrix(array)
        if len(self._buffers) > known:
            flat, wide = list(self._buffers.values())[-1]
            wide[:, 0] = flat
        return matrix

    def take(self) -> None:
        """Take over numbers that Python has changed: their slopes become zero."""
        pairs = list(self._buffers.values())
        present = np.concatenate([flat for flat, _ in pairs])
        before = np.concatenate([wide[:, 0] for _, wide in pairs])
        changed = np.flatnonzero(present.view(np.int64) != before.view(np.int64))
        ends = np.cumsum([flat.size for flat, _ in pairs])
        cuts = [0, *np.searchsorted(changed, ends).tolist()]
        for (flat, wide), one, end, first in zip(pairs, cuts, cuts[1:], ends, strict=False):
            if one < end:
                places = changed[one:end] - first  # from the end
                wide[places] = 0.0
                wide[places, 0] = flat[places]

    def give(self) -> None:
        """Give Python the numbers."""
        for flat, wide in self._buffers.values():
            flat[:] = wide[:, 0]

    def slopes(self, array: Floats) -> Floats:
        """(size, count - 1) view of the slopes of an array."""
        return self.matrix(array)[:, self._lanes]


class Differentiation:
    """Calls of compiled functions with derivatives of all that their arrays hold."""

    def __init__(self, count: int) -> None:
        """Args: numbers for each of the arrays' (value and slopes)."""
        self.count = count
        self._buffers: Buffers = {}
        self._wide: dict[int, tuple[Any, Any]] = {}

    def call(self, function: Any, *arguments: Any) -> None:
        """Call a compiled function of structs, tables and integers in its differentiated form."""
        types = [type_of(argument) for argument in arguments]
        entry = differentiated(function.compile(types), self.count)
        wide = [self.wide(argument) for argument in arguments]
        self.take()
        entry(*wide)
        self._any.give()

    def arrays(self) -> list[Floats]:
        """All numbers, plain and with slopes: copied and put back, all is as before."""
        return [array for pair in self._buffers.values() for array in pair]

    def take(self) -> None:
        """As of ``DifferentiatedArrays``, for all of them."""
        self._any.take()

    def slopes(self, array: Floats) -> Floats:
        """(size, count - 1) view of the slopes of an array."""
        return self._any.slopes(array)

    @property
    def _any(self) -> DifferentiatedArrays:
        """One of the structs: all share their buffers."""
        pairs = self._wide.values()
        return next(wide for _, wide in pairs if isinstance(wide, DifferentiatedArrays))

    def wide(self, argument: Any) -> Any:
        """An argument of a function in the form that differentiated code takes."""
        if not isinstance(argument, (Functions, Arrays)):
            return argument
        if id(argument) not in self._wide:
            wide: Any
            if isinstance(argument, Arrays):
                wide = DifferentiatedArrays(argument, self.count, self._buffers)
            elif argument.values_alone:
                wide = ValueFunctions(argument, self._run_plain)
            else:
                entries = [differentiated(entry, self.count) for entry in argument.entries]
                wide = Functions(argument.signature, entries)
            self._wide[id(argument)] = argument, wide
        return self._wide[id(argument)][1]

    def _run_plain(self, entry: Entry, *addresses: int) -> None:
        """Call a function from differentiated code with the plain arrays."""
        plain = {wide.address: argument for argument, wide in self._wide.values()}
        given = iter([plain[address] for address in addresses])
        self._any.give()
        entry(*(_of_type(type_, given) for type_ in entry.signature.arguments))
        self.take()


def _of_type(type_: Any, items: Iterator[Any]) -> Any:
    """The next of some items, or a tuple of them."""
    if isinstance(type_, Tuple):
        return tuple([_of_type(item, items) for item in type_.items])
    return next(items)
