"""A prepared run as one block of memory: its arrays, and where addresses are stored in it.

All that a run changes is in arrays of ``Arrays`` (kernels/runtime/array_struct.py). Here these are
gathered into one vector of words of 64 bits, in which every address is an offset: copied, and its
addresses filled in, it is a run of its own.
"""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.compiler.units import Entry, Functions, address_of
from dap3d_core.kernels.runtime.array_struct import Arrays

#: Bytes of a word.
WORD = 8


class Image:
    """The memory of a run.

    Attributes:
        words: (w,) int64, the content; zero where an address is stored.
        addresses: word -> the word whose address it stores.
        functions: word -> the function whose address it stores.
    """

    def __init__(self, *parts: Arrays | Functions) -> None:
        """Args: classes of arrays and tables of functions, which are found again by ``at``."""
        self._structs: dict[int, Arrays] = {}
        self._tables: dict[int, Functions] = {}
        self._arrays: dict[tuple[int, int], Any] = {}
        for part in parts:
            self._add(part)
        self._blocks = self._merged()
        size = sum(end - start for start, end in self._blocks) // WORD
        self._first: dict[int, int] = {}
        parts_of: list[Any] = [*self._structs.values(), *self._tables.values()]
        for one in parts_of:
            self._first[one.address] = size
            size += len(one._table if isinstance(one, Arrays) else one.addresses)
        self.words: Integers = np.zeros(size, dtype=np.int64)
        self.addresses: dict[int, int] = {}
        self.functions: dict[int, Entry] = {}
        self._fill()

    def at(self, part: Any) -> int:
        """The word at which an array, a class of arrays or a table begins."""
        if isinstance(part, (Arrays, Functions)):
            return self._first[part.address]
        address, first = address_of(part), 0
        for start, end in self._blocks:
            if start <= address < end:
                return first + (address - start) // WORD
            first += (end - start) // WORD
        raise KeyError("the array is none of the run, or empty")

    def _add(self, part: Any) -> None:
        if isinstance(part, Functions):
            self._tables[part.address] = part
        elif isinstance(part, Arrays):
            if part.address not in self._structs:
                self._structs[part.address] = part
                for member in part:
                    self._add(member)
        elif part is not None and part.size:
            self._arrays[address_of(part), part.nbytes] = part

    def _merged(self) -> list[tuple[int, int]]:
        """First and last address of each piece of memory; arrays that overlap share one.

        In the order in which arrays are found, so that equal models have equal memory.
        """
        found = {key: k for k, key in enumerate(self._arrays)}
        blocks: list[tuple[int, int, int]] = []  # its place in that order, first, last address
        for start, size in sorted(self._arrays):
            k, end = found[start, size], start + size
            if blocks and start < blocks[-1][2]:
                before, start, last = blocks.pop()
                k, end = min(k, before), max(end, last)
            blocks.append((k, start, end))
        return [(start, end) for _, start, end in sorted(blocks)]

    def _fill(self) -> None:
        for array in self._arrays.values():
            content = np.frombuffer(array.tobytes(), dtype=np.int64)
            first = self.at(array)
            self.words[first : first + len(content)] = content
        for struct in self._structs.values():
            word = self.at(struct)
            for name, type_ in struct.type_of().members:
                member = getattr(struct, name)
                if isinstance(member, Arrays) or (member is not None and member.size):
                    self.addresses[word] = self.at(member)
                shape = () if isinstance(member, Arrays) or member is None else member.shape
                self.words[word + 1 : word + 1 + len(shape)] = shape
                word += len(type_.words)
        for table in self._tables.values():
            for k, entry in enumerate(table.entries):
                self.functions[self.at(table) + k] = entry
