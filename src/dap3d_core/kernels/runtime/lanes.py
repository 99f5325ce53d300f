"""Compiled functions and arrays for several scenes of one structure at once, one in each lane.

Sources are those of one scene (kernels/compiler/lanes.py); each lane has the bits of its scene
alone. An array of one scene becomes one in which item k of all scenes lies together.
"""

import functools
import inspect
import threading
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.lanes import widen
from dap3d_core.kernels.compiler.types import FLOAT, Signature, Struct
from dap3d_core.kernels.compiler.units import Entry, Unit, address_of
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.cache import cache_folder, names_of
from dap3d_core.kernels.runtime.source_digest import origin

#: Numbers at whose multiples arrays begin: those of a register of the widest vectors.
ALIGNMENT = 8
_units: dict[str, Unit] = {}
_making = threading.Lock()


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

    with _making:
        if name not in _units:
            _units[name] = Unit(name, 1, write, cache_folder(), optimise=optimise)
        return _units[name]


class WideArrays:
    """A struct of arrays for several scenes; integers and what is not named it shares with one.

    Attributes:
        type: of the struct in compiled code; its lengths are those of one scene.
        address: of its table.
    """

    def __init__(self, arrays: Arrays, count: int, names: Collection[str]) -> None:
        """Args:
        arrays: of one scene.
        count: scenes.
        names: arrays of floats that each scene has for itself, those of further structs behind a
            dot. Wide code may read no other.
        """
        self.type, self._count = arrays.type_of(), count
        self._buffers: dict[int, tuple[Floats, Floats]] = {}
        self._tables: list[Any] = []
        self.address = self._table(arrays, names, "")

    def _table(self, arrays: Arrays, names: Collection[str], before: str) -> int:
        words: list[int] = []
        for name, type_ in arrays.type_of().members:
            array = getattr(arrays, name)
            if isinstance(type_, Struct):
                has = array is not None
                words.append(self._table(array, names, f"{before}{name}.") if has else 0)
                continue
            own = before + name in names and type_.item == FLOAT
            words += [address_of(self.matrix(array) if own else array), *array.shape]
        self._tables.append(np.array(words, dtype=np.int64))
        return address_of(self._tables[-1])

    def matrix(self, array: Floats) -> Floats:
        """(size, count) view: the items of an array of one scene, for each scene.

        Arrays that lie in one array of one scene do so here.
        """
        whole = array if array.base is None else array.base
        if id(whole) not in self._buffers:
            numbers = np.zeros(whole.size * self._count + ALIGNMENT)
            first = -address_of(numbers) // 8 % ALIGNMENT
            end = first + whole.size * self._count
            self._buffers[id(whole)] = whole, numbers[first:end].reshape(-1, self._count)
        wide = self._buffers[id(whole)][1]
        first = (address_of(array) - address_of(whole)) // 8 if array.size else 0
        return wide[first : first + array.size]

    def spread(self) -> None:
        """Give each scene the numbers of the one."""
        for whole, wide in self._buffers.values():
            wide[:] = whole.reshape(-1, 1)
