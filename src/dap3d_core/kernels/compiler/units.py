"""Units of compiled code: made quickly at first, well in the meantime; and the calls into them.

A unit is one object file with some functions. Where it is not kept from an earlier process its code
is made as it stands, which takes a tenth of a second, and a process beside makes it well. Calls
take that over as soon as it is there: addresses in tables are changed, and both codes give the same
bits. Without a second core, or a folder, code is made well here once it has run for as long as that
would take.
"""

import atexit
import contextlib
import ctypes
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.objects import GOOD, QUICK
from dap3d_core.kernels.compiler.types import (
    BOOL,
    DTYPES,
    FLOAT,
    INT,
    NOTHING,
    Array,
    Numbers,
    Signature,
    Struct,
    Table,
    Tuple,
)

#: Making code well takes so many times as long as making it as it stands (measured: 55 to 80).
DEARER = 60.0
#: Seconds between two looks for better code.
PAUSE = 0.02
_C = {
    "double": ctypes.c_double,
    "i64": ctypes.c_int64,
    "i1": ctypes.c_int64,
    "ptr": ctypes.c_void_p,
}


#: Names of the units that this process made: it found no kept code.
made: list[str] = []


class Unit:
    """Functions of one object file."""

    def __init__(
        self,
        name: str,
        count: int,
        write: Callable[[], tuple[str, list[Any]]],
        folder: Path | None,
        at_once: bool = False,
    ) -> None:
        """Args:
        name: a digest of all that decides the code is part of it.
        count: of the functions, whose symbols are NAME_0, NAME_1, ...
        write: gives the text in LLVM IR, and what the functions return, as JSON has it.
        folder: that keeps object files.
        at_once: make it well at once; for short ones.
        """
        self.name = name
        self.symbols = [f"{name.replace('-', '_')}_{k}" for k in range(count)]
        self.path = None if folder is None else folder / f"{name}.o"
        #: Tables that hold addresses: array, place, function.
        self._places: list[tuple[Any, int, int]] = []
        self.text = ""
        self.cost = 0.0
        kept = None if self.path is None else objects.read(self.path)
        if kept is None:
            made.append(name)
            self.text, self.results = write()
            started = time.perf_counter()
            code = objects.object_of(self.text, GOOD if at_once else QUICK)
            self.cost = DEARER * (time.perf_counter() - started)
            if at_once and self.path is not None:
                objects.keep(self.path, self.results, code)
        else:
            self.results, code = kept
        self.is_good = kept is not None or at_once
        self.addresses = objects.load(code, self.symbols)
        if not self.is_good:
            later.add(self)

    def stand_in(self, table: Any, place: int, k: int) -> None:
        """Put the address of a function into a table, now and when there is a better one."""
        table[place] = self.addresses[k]
        if not self.is_good:
            self._places.append((table, place, k))

    def improve(self, code: bytes) -> None:
        """Take over better code."""
        self.addresses[:] = objects.load(code, self.symbols)
        for table, place, k in self._places:
            table[place] = self.addresses[k]
        self._places, self.text, self.is_good = [], "", True


class _Later:
    """Units whose code is to be made well."""

    def __init__(self) -> None:
        self.units: list[Unit] = []
        self._lock = threading.Lock()
        self._process: Any = None
        self._looked = 0.0
        self._spent = 0.0

    def add(self, unit: Unit) -> None:
        """Have the code of a unit made well: by a process beside, where one can be had."""
        with self._lock:
            self.units.append(unit)
        if unit.path is None or _cores() < 2 or self._is_gone():
            return
        path = unit.path.with_name(f"{unit.name}.{os.getpid()}.ll")
        objects.write(path, f"{json.dumps(unit.results)}\n{unit.text}".encode())
        with contextlib.suppress(OSError, ValueError):
            self._beside().stdin.write(f"{path}\t{unit.path}\n".encode())
            self._process.stdin.flush()

    def _is_gone(self) -> bool:
        return self._process is not None and self._process.poll() is not None

    def _beside(self) -> Any:
        if self._process is None:
            nothing = subprocess.DEVNULL
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "dap3d_core.kernels.compiler.beside"],
                stdin=subprocess.PIPE, stdout=nothing, stderr=nothing, start_new_session=True,
            )  # fmt: skip
            atexit.register(self._leave)
        return self._process

    def _leave(self) -> None:
        """It goes on without this process, to the end of what it was given."""
        self._process.stdin.close()
        self._process.returncode = 0  # nobody waits for it

    def look(self, spent: float) -> None:
        """Take over what has become better.

        Args:
            spent: seconds that code ran which is not yet good.
        """
        now = time.perf_counter()
        self._spent += spent
        if now - self._looked < PAUSE or not self._lock.acquire(blocking=False):
            return
        try:
            self._looked = now
            for unit in list(self.units):
                kept = None
                if unit.path is not None and unit.path.exists():
                    kept = objects.read(unit.path)
                if kept is not None:
                    unit.improve(kept[1])
                    self.units.remove(unit)
            if self._process is None or self._is_gone():
                self._make_here()
        finally:
            self._lock.release()

    def _make_here(self) -> None:
        if not self.units or self._spent < sum(unit.cost for unit in self.units):
            return
        for unit in self.units:
            code = objects.object_of(unit.text, GOOD)
            if unit.path is not None:
                objects.keep(unit.path, unit.results, code)
            unit.improve(code)
        self.units, self._spent = [], 0.0


later = _Later()


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Functions:
    """Functions of one signature by their addresses: a table that compiled code calls through."""

    def __init__(self, signature: Signature, entries: "Sequence[Entry]") -> None:
        self.signature = signature
        self.entries = list(entries)
        self.addresses = np.zeros(max(1, len(self.entries)), dtype=np.int64)
        for place, entry in enumerate(self.entries):
            entry.unit.stand_in(self.addresses, place, entry.k)
        self.address = int(self.addresses.ctypes.data)

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, k: int) -> "Entry":
        return self.entries[k]


class Entry:
    """A compiled function as Python calls it: one call of C, without the interpreter's lock."""

    def __init__(self, unit: Unit, k: int, signature: Signature) -> None:
        self.unit, self.k, self.signature = unit, k, signature
        words = [_C[w] for t in signature.arguments for w in t.words]
        result = signature.result.words
        self._kind = ctypes.CFUNCTYPE(_C[result[0]] if result else None, *words)
        self._flatten = [_flattens(type_) for type_ in signature.arguments]
        self._address, self._function = 0, None

    def __call__(self, *arguments: Any) -> Any:
        """Call it.

        Raises:
            TypeError: an argument is not of its type.
        """
        words: list[Any] = []
        for value, flatten in zip(arguments, self._flatten, strict=True):
            flatten(value, words)
        address = self.unit.addresses[self.k]
        if address != self._address:
            self._address, self._function = address, self._kind(address)
        assert self._function is not None
        if not later.units:
            found = self._function(*words)
        else:
            started = time.perf_counter()
            found = self._function(*words)
            later.look(time.perf_counter() - started)
        return bool(found) if self.signature.result == BOOL else found


def address_of(array: Any) -> int:
    """Address of an array's first number; 0 where it has none."""
    if array.size == 0:
        return 0
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # four times faster
    except TypeError:  # it may not be written
        return int(array.ctypes.data)


def _flattens(type_: Any) -> Callable[[Any, list[Any]], None]:
    """What adds the words of an argument of a type to those of others."""
    if isinstance(type_, Array):
        dtype, ndim = DTYPES[type_.item], type_.ndim

        def add(value: Any, words: list[Any]) -> None:
            if value.ndim != ndim or value.dtype != dtype or not value.flags.c_contiguous:
                raise TypeError(f"{value.dtype} with {value.ndim} indices is no {type_}")
            words.append(address_of(value))
            words += value.shape

        return add
    if isinstance(type_, Numbers):
        return lambda value, words: words.append(address_of(value))
    if isinstance(type_, (Struct, Table)):
        return lambda value, words: words.append(value.address)
    if isinstance(type_, Tuple):
        inner = [_flattens(item) for item in type_.items]

        def add_each(value: Any, words: list[Any]) -> None:
            for item, flatten in zip(value, inner, strict=True):
                flatten(item, words)

        return add_each
    if type_ in (INT, BOOL):
        return lambda value, words: words.append(int(value))
    if type_ == NOTHING:
        return lambda value, words: None
    return lambda value, words: words.append(value)


def kind_of(value: Any) -> Any:
    """What tells arguments of different types apart, found quickly."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype.char, value.ndim
    if kind is Functions:
        return value.signature
    return tuple([kind_of(item) for item in value]) if kind is tuple else kind


_ITEMS = {dtype: item for item, dtype in DTYPES.items()}


def type_of(value: Any) -> Any:
    """The type of an argument.

    Raises:
        TypeError: it is nothing that compiled code takes.
    """
    if isinstance(value, np.ndarray):
        if value.dtype not in _ITEMS or not value.flags.c_contiguous:
            raise TypeError(
                f"compiled code takes C-contiguous arrays of float64, int64 or complex128; this "
                f"one has dtype {value.dtype} and strides {value.strides}"
            )
        return Array(_ITEMS[value.dtype], value.ndim)
    if isinstance(value, (bool, np.bool_)):
        return BOOL
    if isinstance(value, (float, np.floating)):
        return FLOAT
    if isinstance(value, (int, np.integer)):
        return INT
    if value is None:
        return NOTHING
    if isinstance(value, Functions):
        return Table(value.signature)
    if isinstance(value, tuple):
        return Tuple(tuple(type_of(item) for item in value))
    if hasattr(type(value), "type_of"):
        return type(value).type_of()
    raise TypeError(f"compiled code takes no {type(value).__name__}")
