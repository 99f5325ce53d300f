"""Kernels to LLVM IR by running them once with symbolic numbers.

Whatever Python does on the way (helpers, closures, loops over constants, tuples) is gone
afterwards; the operations on numbers are recorded as they happen. A kernel may do anything that
Python can, except decide by a number: it has no value yet.
"""

import threading
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.types import FLOAT, INT, Array, CompileError, bits
from dap3d_core.kernels.compiler.writer import EXACT, LIBRARY, call_of

_WORDS = "the words of dap3d_core.kernels: sqrt, sin, minimum, ..., where(condition, a, b)"
#: The trace of this thread.
_current = threading.local()


class TraceError(TypeError):
    """An operation that needs the value of a symbolic number; says what to write instead."""


class _MissingError(TraceError, AttributeError):
    """The same for a missing attribute, so that ``hasattr`` works."""


def _new(text: str) -> str:
    lines = _current.lines
    lines.append(f"  %v{len(lines)} = {text}")
    return f"%v{len(lines) - 1}"


class _Symbolic:
    """A value that is known when the code runs: refuses everything that needs it now."""

    __slots__ = ("word",)
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, word: str) -> None:
        self.word = word

    def _refuse(self, *arguments: Any) -> NoReturn:
        raise TraceError(f"asks for the number itself; use {_WORDS}")

    __float__ = __int__ = __index__ = __complex__ = __len__ = __iter__ = _refuse
    __round__ = __floor__ = __ceil__ = __trunc__ = _refuse
    __floordiv__ = __mod__ = __rfloordiv__ = __rmod__ = __divmod__ = _refuse

    def __bool__(self) -> NoReturn:
        raise TraceError("branches on a number; use where(condition, a, b)")

    def __getattr__(self, name: str) -> NoReturn:
        raise _MissingError(f"asks a number for {name}; use {_WORDS}")

    def __getitem__(self, k: Any) -> NoReturn:
        raise TraceError("takes a part of a number; tuples have parts")

    @property
    def words(self) -> "Words":
        """The functions of kernels.mathematics for symbolic numbers."""
        return Words()


class Condition(_Symbolic):
    """A symbolic truth value."""

    __slots__ = ()

    def _join(self, other: Any, name: str) -> "Condition":
        if not isinstance(other, (Condition, bool)):
            raise TraceError(f"joins a condition and a {type(other).__name__}; compare numbers")
        word = other.word if isinstance(other, Condition) else str(other).lower()
        return Condition(_new(f"{name} i1 {self.word}, {word}"))

    def __and__(self, other: Any) -> "Condition":
        return self._join(other, "and")

    def __or__(self, other: Any) -> "Condition":
        return self._join(other, "or")

    def __xor__(self, other: Any) -> "Condition":
        return self._join(other, "xor")

    def __invert__(self) -> "Condition":
        return self._join(True, "xor")

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__


def _word(x: Any) -> str:
    """The LLVM value of a number, as a double."""
    if isinstance(x, Symbol):
        return x.word
    if isinstance(x, Whole):
        return _new(f"sitofp i64 {x.word} to double")
    try:
        return bits(float(x))
    except (TypeError, ValueError) as error:
        if isinstance(error, TraceError):
            raise
        raise TraceError(f"a {type(x).__name__} stands where a number must be") from None


def _operation(name: str, reflected: bool = False) -> Any:
    def operate(self: "Symbol", other: Any) -> "Symbol":
        if isinstance(other, (tuple, list, str)) or other is None:
            raise TraceError(f"{name[1:]}s a number and a {type(other).__name__}; "
                             "vectors have words: add, sub, scale, dot")  # fmt: skip
        a, b = (other, self) if reflected else (self, other)
        return Symbol(_new(f"{name} double {_word(a)}, {_word(b)}"))

    return operate


def _comparison(relation: str) -> Any:
    def compare(self: "Symbol", other: Any) -> Condition:
        return Condition(_new(f"fcmp {relation} double {_word(self)}, {_word(other)}"))

    return compare


class Symbol(_Symbolic):
    """A symbolic float."""

    __slots__ = ()

    __add__, __radd__ = _operation("fadd"), _operation("fadd", reflected=True)
    __sub__, __rsub__ = _operation("fsub"), _operation("fsub", reflected=True)
    __mul__, __rmul__ = _operation("fmul"), _operation("fmul", reflected=True)
    __truediv__, __rtruediv__ = _operation("fdiv"), _operation("fdiv", reflected=True)
    __lt__, __le__, __gt__, __ge__ = (_comparison(r) for r in ("olt", "ole", "ogt", "oge"))
    __eq__, __ne__ = _comparison("oeq"), _comparison("une")

    def __neg__(self) -> "Symbol":
        return Symbol(_new(f"fneg double {self.word}"))

    def __pos__(self) -> "Symbol":
        return self

    def __abs__(self) -> "Symbol":
        return Words().fabs(self)

    def __pow__(self, n: Any) -> Any:
        """Products for integer constants, a square root for 0.5, else ``pow`` of the C library."""
        if isinstance(n, int) and abs(n) <= 64:
            result, power, left = None, self, abs(n)
            while left:
                if left & 1:
                    result = power if result is None else result * power
                left >>= 1
                if left:
                    power = power * power
            result = 1.0 if result is None else result
            return 1.0 / result if n < 0 else result
        return Words().sqrt(self) if isinstance(n, float) and n == 0.5 else Words().pow(self, n)

    def __rpow__(self, x: Any) -> "Symbol":
        return Words().pow(x, self)

    def rint(self) -> "Symbol":
        """The nearest integer, for ``numpy.rint``."""
        return Words().rint(self)

    @property
    def real(self) -> "Symbol":
        """The number itself: conditions of complex numbers compare real parts."""
        return self


class Whole(_Symbolic):
    """A symbolic integer of the loop, an index or a count; kernels do not see it."""

    __slots__ = ()

    def _with(self, other: Any, name: str) -> "Whole":
        word = other.word if isinstance(other, Whole) else str(int(other))
        return Whole(_new(f"{name} nsw i64 {self.word}, {word}"))

    def __add__(self, other: Any) -> "Whole":
        return self._with(other, "add")

    def __mul__(self, other: Any) -> "Whole":
        return self._with(other, "mul")

    __radd__, __rmul__ = __add__, __mul__


class Words:
    """The functions of kernels.mathematics and kernels.tables, for symbolic numbers."""

    def __getattr__(self, name: str) -> Callable[..., Symbol]:
        if name not in (*EXACT, *LIBRARY):
            raise AttributeError(name)

        return lambda *numbers: Symbol(
            _new(call_of(_current.program.needs, name, [_word(x) for x in numbers]))
        )

    def where(self, condition: Condition, a: Any, b: Any) -> Any:
        """``a`` where the condition holds, else ``b``; tuples item by item."""
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(self.where(condition, x, y) for x, y in zip(a, b, strict=True))
        if isinstance(a, Condition) and isinstance(b, Condition):
            return Condition(_new(f"select i1 {condition.word}, i1 {a.word}, i1 {b.word}"))
        text = f"select i1 {condition.word}, double {_word(a)}, double {_word(b)}"
        return Symbol(_new(text))

    def whole(self, x: Any) -> Whole:
        """A float as an integer."""
        return Whole(_new(f"fptosi double {_word(x)} to i64"))

    def row_of(self, row: Any, array: "Numbers", place: Any, rows: Any, width: int, x: Any) -> Any:
        """Index at which a row of a table begins, found by a function of the subset."""
        name, _ = _current.program.function(row, (Array(FLOAT, 1), INT, INT, INT, FLOAT))
        given = (f"ptr {array.base}, i64 0, i64 {self.whole(place).word}, "
                 f"i64 {self.whole(rows).word}, i64 {width}, double {_word(x)}")  # fmt: skip
        return Whole(_new(f"call i64 @{name}({given})"))


class Numbers:
    """An array of a loop: one-dimensional, or with rows of a known width."""

    words = Words()

    def __init__(self, base: str, item: str = "double", width: int = 0) -> None:
        self.base, self._item, self._width = base, item, width

    def _at(self, k: Any) -> str:
        if isinstance(k, tuple):
            k = k[0] * self._width + k[1]
        word = k.word if isinstance(k, Whole) else str(int(k))
        return _new(f"getelementptr inbounds {self._item}, ptr {self.base}, i64 {word}")

    def __getitem__(self, k: Any) -> Any:
        kind = Whole if self._item == "i64" else Symbol
        return kind(_new(f"load {self._item}, ptr {self._at(k)}, align 8"))

    def __setitem__(self, k: Any, x: Any) -> None:
        word = _word(x)
        at = self._at(k)
        _current.lines.append(f"  store double {word}, ptr {at}, align 8")


class _Arrays:
    """The arrays of a loop (lists.LoopArrays)."""


def trace(
    symbol: str,
    namespace: dict[str, Any],
    members: Mapping[str, tuple[int, str, int]],
) -> str:
    """LLVM IR of a group loop.

    Args:
        symbol: name of its function.
        namespace: of the module with the Python function ``loop``
        (kernels/runtime/loop_modules.py). members: for each array that it reads: index of its
        address in the struct, LLVM type of its
            items, width of its rows (0: one-dimensional).

    Raises:
        CompileError: with the line of the kernel, and what to write instead.
    """
    program = Program()
    arrays: Any = _Arrays()
    head = []
    for name, (word, item, width) in members.items():
        head += [f"  %{name}.at = getelementptr inbounds i64, ptr %arrays, i64 {word}",
                 f"  %{name} = load ptr, ptr %{name}.at, align 8"]  # fmt: skip
        setattr(arrays, name, Numbers(f"%{name}", item, width))
    outputs = [Numbers(f"%out{k}") for k in (1, 2, 3)]
    before = vars(_current).copy()
    _current.lines, _current.program = [], program
    namespace["range"] = lambda count: [Whole("%q")]  # one symbolic instance q
    try:
        namespace["loop"](
            Symbol("%t"), arrays, Whole("%i0"), Whole("%p0"), Whole("%count"), *outputs
        )
        lines = _current.lines
    except Exception as error:
        raise CompileError(f"{_reason(error)}{_line_of(error)}") from error
    finally:
        vars(_current).clear()
        vars(_current).update(before)
    program.text.append(
        _FUNCTION.format(symbol=symbol, head="\n".join(head), body="\n".join(lines))
    )
    return program.module()


_FUNCTION = """define void @{symbol}(double %t, ptr %arrays, i64 %i0, i64 %p0, i64 %count,
                           ptr %out1, ptr %out2, ptr %out3) nounwind {{
entry:
{head}
  %some = icmp sgt i64 %count, 0
  br i1 %some, label %instance, label %exit
instance:
  %q = phi i64 [0, %entry], [%following, %instance]
{body}
  %following = add nsw i64 %q, 1
  %more = icmp slt i64 %following, %count
  br i1 %more, label %instance, label %exit
exit:
  ret void
}}
"""


def _reason(error: BaseException) -> str:
    if isinstance(error, TraceError):
        return f"it {error}"
    return f"{type(error).__name__}: {error}; use {_WORDS}"


def _line_of(error: BaseException) -> str:
    """The line of the kernel: the last one outside this package."""
    ours = Path(__file__).parents[1]
    found = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if not frame.filename.startswith("<") and not Path(frame.filename).is_relative_to(ours):
            found = f" [{frame.filename}:{frame.lineno}]"
    return found
