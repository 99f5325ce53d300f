"""Units of compiled code, and calls from Python into them.

A unit is one object file with some functions. Code that is not in the cache folder is compiled
unoptimised, which takes a tenth of a second, and replaced once the optimised code is available
(background.py). Addresses in tables are then changed; both versions give the same bits.
"""

import ctypes
import functools
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dap3d_core.kernels.compiler import background, objects
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.runtime import ready

#: Time of optimised compilation over that of unoptimised compilation (measured: 55 to 80).
COST_RATIO = 60.0
_C_TYPES = {"double": ctypes.c_double, "i64": ctypes.c_int64, "i1": ctypes.c_bool,
            "ptr": ctypes.c_void_p}  # fmt: skip
_ITEMS = {dtype: item for item, dtype in t.DTYPES.items()}
#: Names of the units that this process compiled rather than loaded.
compiled_units: list[str] = []
#: Of compiled units, by their names among ready-made objects: LLVM IR and results. None where they
#: are not collected; only tools/ready_objects.py does.
collected: dict[str, tuple[str, list[Any]]] | None = None


class Unit:
    """Functions of one object file.

    Attributes:
        symbols: NAME_0, NAME_1, ...: one for each function.
        name, ready_name, write: as given; the last writes the code anew, for another target.
        results: what ``write`` returned with the code, read back from the object file.
        cost: estimated seconds to optimise it.
        has_slopes: its code is differentiated.
    """

    has_slopes = False

    def __init__(
        self,
        name: str,
        count: int,
        write: Callable[[list[str]], tuple[str, list[Any]]],
        folder: Path | None,
        optimise: bool = False,
        ready_name: str = "",
    ) -> None:
        """Load the unit from its object file or from ready-made objects, or compile it.

        Args:
            name: contains a digest of everything that decides the code.
            count: number of functions.
            write: takes the symbols; returns LLVM IR, and JSON values stored with the code.
            folder: of object files.
            optimise: compile optimised code at once; for short code.
            ready_name: name among ready-made objects, of which symbols are made as well.
        """
        self.name, self.ready_name, self.write = name, ready_name, write
        symbol = (ready_name or name).replace("-", "_")
        self.symbols = [f"{symbol}_{k}" for k in range(count)]
        self.path = None if folder is None else folder / f"{name}.o"
        #: Table, index and function of each registered address.
        self._slots: list[tuple[Any, int, int]] = []
        self.text, self.cost = "", 0.0
        stored = None if self.path is None else objects.read_object(self.path)
        stored = stored or ready.read(ready_name)
        self.is_optimised = stored is not None or optimise
        self.results, code = stored or self._compile(write, ready_name)
        self.addresses = objects.load(code, self.symbols)
        if not self.is_optimised:
            background.optimiser.add(self)

    def _compile(self, write: Callable[..., Any], ready_name: str) -> tuple[list[Any], bytes]:
        compiled_units.append(self.name)
        self.text, results = write(self.symbols)
        if collected is not None:
            collected[ready_name] = self.text, results
        if self.is_optimised:
            return results, objects.optimised(self.text, results, self.path)
        start = time.perf_counter()
        code = objects.compile_ir(self.text, objects.UNOPTIMISED)
        self.cost = COST_RATIO * (time.perf_counter() - start)
        return results, code

    def fresh_text(self, symbols: list[str]) -> str:
        """LLVM IR of the unit under other symbols; also where its code was loaded."""
        text = self.text or self.write(symbols)[0]
        for old, new in zip(self.symbols if self.text else (), symbols, strict=False):
            text = text.replace(f"@{old}(", f"@{new}(")
        return text

    def register_slot(self, table: Any, index: int, k: int) -> None:
        """Store the address of function k in a table, now and whenever it changes."""
        table[index] = self.addresses[k]
        if not self.is_optimised:
            self._slots.append((table, index, k))

    def replace_code(self, code: bytes) -> None:
        """Load optimised code and update all registered addresses."""
        self.addresses[:] = objects.load(code, self.symbols)
        for table, index, k in self._slots:
            table[index] = self.addresses[k]
        self._slots, self.text, self.is_optimised = [], "", True


class Functions:
    """A table of addresses of functions of one signature, for calls from compiled code.

    Attributes:
        values_alone: what they compute needs no derivatives in differentiated code.
    """

    def __init__(
        self, signature: t.Signature, entries: "Sequence[Entry]", values_alone: bool = False
    ) -> None:
        self.signature, self.values_alone = signature, values_alone
        self.entries = list(entries)
        self.addresses = np.zeros(max(1, len(self.entries)), dtype=np.int64)
        for index, entry in enumerate(self.entries):
            entry.unit.register_slot(self.addresses, index, entry.k)
        self.address = address_of(self.addresses)

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, k: int) -> "Entry":
        return self.entries[k]


class Entry:
    """A compiled function as Python calls it: one C call, without the interpreter's lock."""

    def __init__(self, unit: Unit, k: int, signature: t.Signature) -> None:
        self.unit, self.k, self.signature = unit, k, signature
        self._address: int = 0
        self._function: Any = None
        self._words: Any = None
        self._unchecked: Any = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the function.

        Raises:
            TypeError: an argument has another type than the signature.
        """
        if self._words is None:  # many entries are never called from Python
            self._words = _words_of(self.signature.arguments)
        return self._run(*self._words(*arguments))

    def unchecked(self, *arguments: Any) -> Any:
        """As ``__call__``, with arguments of these types."""
        if self._unchecked is None:
            self._unchecked = _words_of(self.signature.arguments, is_checked=False)
        return self._run(*self._unchecked(*arguments))

    def prepared(self, *arguments: Any) -> Callable[..., Any]:
        """The function with its first arguments, to be called with the scalars that follow them."""
        words = _words_of(self.signature.arguments[: len(arguments)])
        self._bind()
        is_final = self.unit.is_optimised and not background.optimiser.units
        call = functools.partial(self._function if is_final else self._run, *words(*arguments))
        vars(call)["arguments"] = arguments  # which their words do not keep alive
        return call

    def _run(self, *words: Any) -> Any:
        if self.unit.addresses[self.k] != self._address:
            self._bind()
        if not background.optimiser.units:
            return self._function(*words)
        start = time.perf_counter()
        result = self._function(*words)
        background.optimiser.poll(time.perf_counter() - start)
        return result

    def _bind(self) -> None:
        self._address = self.unit.addresses[self.k]
        words = [_C_TYPES[w] for kind in self.signature.arguments for w in kind.words]
        result = [_C_TYPES[w] for w in self.signature.result.words] or [None]
        self._function = ctypes.CFUNCTYPE(result[0], *words)(self._address)


def address_of(array: Any) -> int:
    """Address of the first item of a C-contiguous array; 0 where it is empty.

    Raises:
        TypeError: it is not C-contiguous.
    """
    try:
        # four times faster than array.ctypes.data
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    except (TypeError, ValueError):  # read-only, empty, or not contiguous
        if not array.flags.c_contiguous:
            raise TypeError(f"an array with strides {array.strides} is not C-contiguous") from None
        return int(array.ctypes.data) if array.size else 0


def _words_of(types: Sequence[Any], *, is_checked: bool = True) -> Callable[..., Any]:
    """A Python function that returns the machine words of arguments, unless of other types.

    It is generated, as ``collections.namedtuple`` does: loops and closures take twice as long.
    """
    checks: dict[str, Any] = {"address_of": address_of}
    words = [_words_text(f"a{k}", type_, checks, is_checked) for k, type_ in enumerate(types)]
    names = ", ".join(f"a{k}" for k in range(len(types)))
    source = f"lambda {names}: [{', '.join(filter(None, words))}]"
    return eval(source, checks)


def _words_text(name: str, type_: Any, checks: dict[str, Any], is_checked: bool) -> str:
    """Python text of the machine words of an argument; adds the functions that it calls."""
    if isinstance(type_, t.Array) and type_.ndim > 0:
        if not is_checked:
            return f"address_of({name}), *{name}.shape"
        checks[f"array{len(checks)}"] = _array_check(type_)
        return f"array{len(checks) - 1}({name}), *{name}.shape"
    if isinstance(type_, t.Tuple):
        items = enumerate(type_.items)
        parts = (_words_text(f"{name}[{k}]", item, checks, is_checked) for k, item in items)
        return ", ".join(filter(None, parts))
    if isinstance(type_, t.Scalar):
        return {t.INT: f"int({name})", t.NOTHING: ""}.get(type_, name)
    return f"address_of({name})" if isinstance(type_, t.Array) else f"{name}.address"


def _array_check(type_: t.Array) -> Callable[[Any], int]:
    dtype, ndim = t.DTYPES[type_.item], type_.ndim

    def checked_address(array: Any) -> int:
        if array.dtype != dtype or array.ndim != ndim:
            raise TypeError(f"{array.dtype} with {array.ndim} indices is no {type_}")
        return address_of(array)

    return checked_address


def kind_of(value: Any) -> Any:
    """A key that distinguishes arguments of different types; faster than ``type_of``."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype.char, value.ndim
    if kind is Functions:
        return value.signature
    return tuple([kind_of(item) for item in value]) if kind is tuple else kind


def type_of(value: Any) -> Any:
    """The type of an argument.

    Raises:
        TypeError: compiled code has no type for it.
    """
    if isinstance(value, np.ndarray):
        if value.dtype not in _ITEMS or not value.flags.c_contiguous:
            raise TypeError(
                f"compiled code takes C-contiguous arrays of float64, int64 or complex128; this "
                f"one has dtype {value.dtype} and strides {value.strides}"
            )
        return t.Array(_ITEMS[value.dtype], value.ndim)
    for classes, type_ in _SCALARS:
        if isinstance(value, classes):
            return type_
    if isinstance(value, Functions):
        return t.Table(value.signature)
    if isinstance(value, tuple):
        return t.Tuple(tuple(type_of(item) for item in value))
    if hasattr(type(value), "type_of"):
        return type(value).type_of()
    raise TypeError(f"compiled code takes no {type(value).__name__}")


_SCALARS = (((bool, np.bool_), t.BOOL), ((float, np.floating), t.FLOAT), ((int, np.integer), t.INT),
            (type(None), t.NOTHING))  # fmt: skip
